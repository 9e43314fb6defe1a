"""What the results of a claim say: our ratios with their intervals, and a verdict.

A comparison is "reproduced" where its 95 % interval lies above what it must exceed (1 unless the claim says otherwise) and, where the paper states a value, reaches that; "in part"
where the order holds and the interval ends below the published value; "not" where the interval lies below; "undecided" where it does neither, or where there is none.
"""

import math
from dataclasses import dataclass, replace

from ambilux.analysis import efficiency, heavy_tails, same_estimator, statistics, summary, tables
from ambilux.analysis import experiment as experiments
from ambilux.analysis.claims import registry, run

SAYS = ("reproduced", "in part", "not", "undecided")
OVER = "pairs of turns"


@dataclass(frozen=True)
class Found:
    """One comparison. measures: {one of registry.MEASURES: heavy_tails.Judged}, what was measured of them; says: one of SAYS, why: in words."""

    compare: registry.Compare
    measures: dict
    says: str
    why: str


@dataclass(frozen=True)
class Outcome:
    """verdict: one of SAYS, or "not run". evidence: a run at full size, on a device where the claim needs one. left_out: names of scenes that were not there."""

    claim: registry.Claim
    status: dict
    found: tuple
    verdict: str
    why: str
    left_out: tuple = ()
    data: experiments.Experiment | None = None  # of an experiment
    benches: tuple = ()  # what `ambilux bench` wrote

    @property
    def evidence(self):
        return bool(self.found) and not self.status["small"]


def equal_samples(data, scene, names):
    """Judged of the second run's error over the first one's, at the last checkpoint in samples that all runs have."""
    sets = [set(data.checkpoints(scene, r, "spp")) for r in data.runs if data.select(scene, r)]
    if not sets or not (common := set.intersection(*sets)):
        return None
    rows = [data.select(scene, name, max(common)) for name in names]
    over_batches = [efficiency.of_batches(data, scene, name, data.metric, r) for name, r in zip(names, rows)]
    over_seeds = [efficiency.of_seeds(r, data.metric) for r in rows]
    works = [[b and replace(b, seconds=None), replace(s, rows=s.rows[:, :1])] for b, s in zip(over_batches, over_seeds)]
    return efficiency.lead(*summary.ratios(*works, names[1]))


def of_experiment(claim, data, compare):
    """{measure: Judged}."""
    scene, names = compare.scene, (compare.run, compare.over)
    if claim.measure == "of rates":
        return {"of rates": same_estimator.time_ratio(data, scene, *names)}
    at_time = summary.ratio_over(data, scene, *names) if data.last_common_checkpoint(scene) is not None and "seconds" in data.budgets else None
    found = {"at equal time": at_time, "at equal samples": equal_samples(data, scene, names)}
    return {measure: efficiency.root(j) if claim.error == "rmse" else j for measure, j in found.items() if j is not None}


def rate(bench, batch, kernel):
    """Millions of rays a second of a batch in what a bench wrote."""
    for row in bench["rows"]:
        if row["batch"] == batch and kernel in ("", row["kernel"]):
            return row["mrays_per_s"]
    raise experiments.InputError(f"bench rays has no batch '{batch}'" + (f" by kernel '{kernel}'" if kernel else ""))


def of_bench(claim, out, compare):
    """({"of rates": Judged over turns}, what the benches wrote)."""
    runs, pairs, read = [claim.bench.runs[name] for name in (compare.run, compare.over)], [], []
    for turn in range(1, claim.bench.turns + 1):
        files = [run.bench_file(out, compare.scene, r, turn) for r in runs]
        if all(file.is_file() for file in files):
            benches = [experiments.read_json(file) for file in files]
            pairs.append([rate(b, compare.batch, r.kernel) for b, r in zip(benches, runs)])
            read += benches
    if not pairs:
        return {}, read
    e = statistics.ratio_of_pairs(*zip(*pairs))
    judged = heavy_tails.Judged(e.value, e.low, e.high, math.nan, OVER, len(pairs)) if len(pairs) > 1 else heavy_tails.unknown(e.value, OVER, 1, "1 turn")
    return {"of rates": judged}, read


def said(compare, j):
    """(one of SAYS, why) of a comparison's ratio."""
    if j is None:
        return "undecided", "nothing was measured"
    if not j.trusted:
        return "undecided", f"{tables.number(j.value)} without an interval: {j.doubt}"
    if j.high < compare.above:
        return "not", f"{tables.interval(j)} is below {compare.above:g}"
    if not j.low > compare.above:
        return "undecided", f"{tables.interval(j)} holds {compare.above:g}"
    if compare.published and j.high < compare.published[0]:
        return "in part", f"{tables.interval(j)} is above {compare.above:g} and ends below the published {compare.published[0]:g}"
    return "reproduced", f"{tables.interval(j)}"


def found_of(claim, measures, compare):
    return Found(compare, measures, *said(compare, measures.get(claim.measure)))


def verdict(found):
    """(one of SAYS, why): that of all comparisons where they agree; "in part" where some hold."""
    every = [f.says for f in found]
    counts = ", ".join(f"{every.count(s)} {s}" for s in SAYS if s in every)
    holds = {"reproduced", "in part"} & set(every)
    said_all = every[0] if len(set(every)) == 1 else "in part" if holds else "not" if "not" in every else "undecided"
    return said_all, f"of {len(every)} comparisons {counts}" if len(every) > 1 else found[0].why


def outcome(claim, out):
    """What the folder `out` holds of a claim."""
    status = run.status(out, claim)
    if status["state"] != "run":
        reasons = {"dry run": "a dry run: it needs a device", "failed": f"a command failed: {status['message']}", "not run": "nothing was run yet"}
        return Outcome(claim, status, (), "not run", reasons[status["state"]])
    data, benches = None, ()
    if claim.experiment:
        data = experiments.load(run.results(out, claim))
        there = {c: of_experiment(claim, data, c) for c in claim.compares if c.scene in data.scenes}
    else:
        measured = {c: of_bench(claim, out, c) for c in claim.compares}
        there = {c: measures for c, (measures, read) in measured.items() if read}
        benches = tuple(b for _, read in measured.values() for b in read)
    left_out = tuple(dict.fromkeys(c.scene for c in claim.compares if c not in there))
    found = tuple(found_of(claim, measures, c) for c, measures in there.items())
    if not found:
        return Outcome(claim, status, (), "not run", f"none of its scenes is there: {', '.join(left_out)}", left_out)
    return Outcome(claim, status, found, *verdict(found), left_out, data, benches)


def counted(outcomes):
    """"14 claims: 3 reproduced, 2 in part, 1 not, 4 undecided, 4 not run"."""
    every = [o.verdict for o in outcomes]
    return f"{len(every)} claims: " + ", ".join(f"{every.count(v)} {v}" for v in (*SAYS, "not run"))
