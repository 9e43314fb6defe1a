"""What the results of a claim say: our ratios with their intervals, and a verdict.

A comparison is "reproduced" where its 95 % interval lies above what it must exceed (1 unless the claim says otherwise)
and, where the paper states a value, reaches that; "in part" where the order holds and the interval ends below the
published value; "not" where the interval lies below; "undecided" where it does neither, or where there is none.
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
    """One comparison. measures: {of registry.MEASURES: heavy_tails.Judged}; says: one of SAYS; why: in words."""

    compare: registry.Compare
    measures: dict
    says: str
    why: str


@dataclass(frozen=True)
class Outcome:
    """verdict: one of SAYS, or "not run". left_out: names of scenes that were not there."""

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
        """Whether it was run at full size, on a device where the claim needs one."""
        return bool(self.found) and not self.status["small"]


def is_biased(data, scene, names):
    """Whether one of the runs says so: then batches, whose scatter holds no bias, tell nothing of its error."""
    return any(r.stated_bias for name in names for r in data.select(scene, name))


def equal_time(data, scene, names):
    """Judged of the second run's error times time over the first one's, at the last checkpoint that all runs have."""
    if not is_biased(data, scene, names):
        return summary.ratio_over(data, scene, *names)
    rows = [data.select(scene, name, data.last_common_checkpoint(scene)) for name in names]
    return efficiency.ratio(*(efficiency.of_seeds(r, data.metric) for r in rows), names[1])


def equal_samples(data, scene, names):
    """Judged of the second run's error over the first one's, at the last checkpoint in samples that all runs have."""
    sets = [set(data.checkpoints(scene, r, "spp")) for r in data.runs if data.select(scene, r)]
    common = set.intersection(*sets) if sets else set()
    if not common:
        return None
    works, biased = [], is_biased(data, scene, names)
    for name in names:
        rows = data.select(scene, name, max(common))
        batches = None if biased else efficiency.of_batches(data, scene, name, data.metric, rows)
        seeds = efficiency.of_seeds(rows, data.metric)
        works.append((batches and replace(batches, seconds=None), replace(seeds, rows=seeds.rows[:, :1])))
    return efficiency.lead(*summary.ratios(*works, names[1]))


def of_experiment(claim, data, compare):
    """{measure: Judged}."""
    scene, names = compare.scene, (compare.run, compare.over)
    if claim.measure == "of rates":
        return {"of rates": same_estimator.time_ratio(data, scene, *names)}
    found = {"at equal samples": equal_samples(data, scene, names)}
    if "seconds" in data.budgets and data.last_common_checkpoint(scene) is not None:
        found["at equal time"] = equal_time(data, scene, names)
    root = efficiency.root if claim.error == "rmse" else lambda j: j
    return {measure: root(j) for measure, j in found.items() if j is not None}


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
    judged = heavy_tails.Judged(e.value, e.low, e.high, math.nan, OVER, len(pairs), "" if len(pairs) > 1 else "1 turn")
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
        return "undecided", f"{tables.interval(j)} contains {compare.above:g}"
    if compare.published and j.high < compare.published[0]:
        return "in part", f"{tables.interval(j)} ends below the published {compare.published[0]:g}"
    return "reproduced", tables.interval(j)


def verdict(found):
    """(one of SAYS, why): that of all comparisons where they agree; else "in part" where some hold, and "not"."""
    every = [f.says for f in found]
    holds = {"reproduced", "in part"} & set(every)
    together = every[0] if len(set(every)) == 1 else "in part" if holds else "not"
    counts = ", ".join(f"{every.count(s)} {s}" for s in SAYS if s in every)
    return together, f"of {len(every)} comparisons {counts}" if len(every) > 1 else found[0].why


def measured(claim, out):
    """({compare: measures} of scenes that are there, Experiment or None, what benches wrote)."""
    if claim.experiment:
        data = experiments.load(run.results(out, claim))
        return {c: of_experiment(claim, data, c) for c in claim.compares if c.scene in data.scenes}, data, ()
    found = {c: of_bench(claim, out, c) for c in claim.compares}
    return {c: m for c, (m, read) in found.items() if read}, None, tuple(b for _, read in found.values() for b in read)


def outcome(claim, out):
    """What the folder `out` holds of a claim."""
    status = run.status(out, claim)
    if status["state"] != "run":
        reasons = {"dry run": "a dry run, since it needs a device", "failed": f"a command failed: {status['message']}"}
        return Outcome(claim, status, (), "not run", reasons.get(status["state"], "nothing was run yet"))
    there, data, benches = measured(claim, out)
    left_out = tuple(dict.fromkeys(c.scene for c in claim.compares if c not in there))
    found = tuple(Found(c, m, *said(c, m.get(claim.measure))) for c, m in there.items())
    if not found:
        return Outcome(claim, status, (), "not run", f"none of its scenes is there: {', '.join(left_out)}", left_out)
    return Outcome(claim, status, found, *verdict(found), left_out, data, benches)


def counted(every):
    """"14 claims: 3 reproduced, 2 in part, 1 not, 4 undecided, 4 not run", of their verdicts."""
    return f"{len(every)} claims: " + ", ".join(f"{every.count(v)} {v}" for v in (*SAYS, "not run"))
