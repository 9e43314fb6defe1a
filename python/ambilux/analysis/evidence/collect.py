"""From results of stages to what docs/data holds of them. At home: needs NumPy."""

import json
import math
import shutil

from ambilux.analysis import experiment as experiments
from ambilux.analysis import peers, remarks, same_estimator, summary, tables, verdicts
from ambilux.analysis.evidence import data, run, stages

# A reference is fit for errors of which its own variance is at most a tenth: relMSE and the variance are squares.
NOISE = 0.1
FEWEST = 10  # samples of a reference over those of the longest run, unless its method has less noise
LEADING = ("scene", "run", "spp", "relMSE", "ratio [95 %]", "time to equal RMSE")
# MAPE and FLIP hold the noise of the reference, which nothing can take out: they are in no table.
FURTHER = ("scene", "run", "RMSE", "trimmed relMSE")


def noise_share(experiment, scene):
    """Variance of the reference over the least corrected relMSE of the scene's runs at their last checkpoint; NaN if unknown."""
    last = experiment.last_common_checkpoint(scene)
    rows = [r for run_name in experiment.runs for r in experiment.select(scene, run_name, last)] if last is not None else []
    known = [(r.relmse - r.relmse_corrected, r.relmse_corrected) for r in rows if r.relmse_corrected > 0]
    return max(n for n, _ in known) / min(e for _, e in known) if known else math.nan


def longest(experiment, scene):
    """(samples of a pixel, relMSE times samples) of the run with most samples."""
    rows = [r for name in experiment.runs for r in experiment.select(scene, name) if r.relmse_corrected > 0]
    return max(((r.spp, r.relmse_corrected * r.spp) for r in rows), default=(0, math.nan))


def reference_spp(experiment, scene):
    return (experiment.scene_entry(scene).get("reference") or {}).get("spp", 0)


def reference_variance(experiment, scene):
    """Of one sample of the reference, as relMSE; NaN if unknown."""
    noise = [r.relmse - r.relmse_corrected for name in experiment.runs for r in experiment.select(scene, name) if r.relmse_corrected > 0]
    return max(noise, default=math.nan) * reference_spp(experiment, scene)


def unfit(experiment, scene, stage):
    """Why no errors against the scene's reference are shown; empty if they are."""
    if scene in stage.spread:
        return "no method gives a converged reference: relMSE between images of different seeds stands in place of errors"
    noise, spp, (most, variance) = noise_share(experiment, scene), reference_spp(experiment, scene), longest(experiment, scene)
    if not noise <= NOISE:
        return f"the variance of its reference is {noise:.2g} of the least relMSE, more than {NOISE:g}: no errors are shown"
    if spp < FEWEST * most and not reference_variance(experiment, scene) < variance:
        return f"its reference has {spp} samples, the longest run {most} of no more noise: no errors are shown"
    return ""


def references(experiment, stage):
    """A sentence for each scene: how its reference was made, and how noisy it is."""
    for scene in experiment.scenes:
        spp, (most, _) = reference_spp(experiment, scene), longest(experiment, scene)
        if reason := unfit(experiment, scene, stage):
            yield f"{scene}: {reason}"
        elif most:
            yield (f"{scene}: reference of {spp} samples, {spp / most:.3g} times those of the longest run; "
                   f"its variance is {noise_share(experiment, scene):.2g} of the least relMSE")


# Tables of an experiment

def number_cells(row, base, biased):
    """{heading: cell} of a line of the summary."""
    ratio = 1 if row.run == base else None if row.ratio is None else data.judged(row.ratio, True, " =" if row.ratio is row.ratio_time else "")
    return {"scene": row.scene, "run": row.run, "spp": tables.number(row.spp), "relMSE": data.judged(row.relmse), "RMSE": data.judged(row.rmse),
            "ratio [95 %]": ratio, "time to equal RMSE": tables.minus(tables.speedup_text(row, base, biased)),
            "trimmed relMSE": tables.minus(tables.trimmed_text(row))}


ERRORS = ("relMSE", "RMSE", "trimmed relMSE", "ratio [95 %]", "time to equal RMSE")


def lines_table(experiment, lines, bad, shown):
    """The columns `shown`; of scenes whose reference is unfit there are no errors."""
    biased, rows = verdicts.biased(lines), []
    for row in lines:
        cells = number_cells(row, experiment.base, biased)
        if row.scene in bad:
            keep = row.ratio_time is not None or row.run == experiment.base  # of one estimator: a ratio of times
            cells.update({h: None for h in ERRORS if not (keep and h == "ratio [95 %]")})
        rows.append([cells[h] for h in shown])
    return {"columns": list(shown), "rows": rows, "grouped": True}


def pivot(experiment, lines, of):
    """Runs by scenes."""
    scenes = [s for s in experiment.scenes if any(x.scene == s for x in lines)]
    found = {(x.run, x.scene): of(x) for x in lines}
    return {"columns": ["run", *scenes], "rows": [[name, *(found.get((name, s)) for s in scenes)] for name in experiment.runs]}


def span(values):
    good = [v for v in values if v is not None and not math.isnan(v)]
    return f"{min(good):.2f} to {max(good):.2f}" if good else None


def switches_table(experiment, lines, bad):
    """Least and greatest of the scenes: time of the default over that of the run, and efficiency where images change."""
    base, rows = experiment.base, []
    times = {(s, r): same_estimator.seconds_per_sample(experiment, s, r) for s in experiment.scenes for r in experiment.runs}

    def mean(scene, name):
        return sum(times[scene, name].values()) / len(times[scene, name]) if times[scene, name] else math.nan
    for name in experiment.others:
        of_run = [x for x in lines if x.run == name]
        changed = [x.ratio.value for x in of_run if x.ratio is not None and x.ratio_time is None and x.scene not in bad]
        rows.append([f"`{experiments.settings_of(name)[0]}` {name[len(base):]}", span([mean(x.scene, base) / mean(x.scene, name) for x in of_run]), span(changed)])
    return {"columns": ["setting", "time of the default over its time", "efficiency, where the image changes"], "rows": rows}


def agreement_cell(entry):
    a = entry.get("agreement") or {}
    if entry["state"] == "refused":
        return f"{peers.STATES[entry['state']]}: {entry.get('reason') or 'no reason given'}"
    if a.get("relative_difference") is None:
        return peers.STATES[entry["state"]]
    bound = "" if a.get("mean_bound") is None else f", at most {peers.percent(a['mean_bound'])}"
    return f"{peers.verdict(entry)}: {tables.minus(format(100 * a['relative_difference'], '+.2g'))} %{bound}"


def agreement_table(experiment):
    found = {(e["scene"], e["run"]): e for e in peers.entries(experiment)}
    runs = list(dict.fromkeys(run_name for _, run_name in found))
    return {"columns": ["scene", *runs], "rows": [[s, *(agreement_cell(found[s, r]) if (s, r) in found else None for r in runs)] for s in experiment.scenes]}


def error_or_spread(bad, spread):
    """Cell of a line: relMSE, or where no method makes a reference, how much the images of seeds differ, as relMSE between them."""
    spreads = {(s["scene"], s["run"]): f"({tables.minus(tables.number(s['relmse']))})" for s in spread}
    return lambda x: spreads.get((x.scene, x.run)) if x.scene in bad else x.relmse.value


def blocks(experiment, stage, spread):
    lines = summary.lines(experiment)
    bad = {scene for scene in experiment.scenes if unfit(experiment, scene, stage)}

    def fit(of):
        return lambda x: None if x.scene in bad else of(x)
    makers = {
        "table": lambda: lines_table(experiment, lines, bad, LEADING),
        "further": lambda: lines_table(experiment, lines, bad, FURTHER),
        "errors": lambda: pivot(experiment, lines, error_or_spread(bad, spread)),
        "ratios": lambda: pivot(experiment, lines, fit(lambda x: number_cells(x, experiment.base, set())["ratio [95 %]"])),
        "samples": lambda: pivot(experiment, lines, lambda x: tables.number(x.spp)),
        "switches": lambda: switches_table(experiment, lines, bad),
        "agreement": lambda: agreement_table(experiment),
        "remarks": lambda: {"list": [tables.minus(text) for text in remarks.remarks(experiment, lines)]},
    }
    made = {kind: makers[kind]() for kind in stage.kinds}
    return made | {"references": {"list": list(references(experiment, stage))}}


def draw(experiment, stage, made):
    """The figures of a stage, into the folder `made`. Without images of the scenes there is no comparison."""
    from ambilux.analysis import figures as drawing
    from ambilux.analysis.__main__ import write
    made.mkdir(exist_ok=True)
    for group, make in drawing.plan(experiment, {}):
        if any(name.startswith(group) for name in stage.figures):
            for _, reason in (one := drawing.make_one(group, make, experiment, made, write)).missing + one.broken:
                print(f"{stage.name}: {group} was not drawn: {reason}")


def figures(experiment, place, stage, pictures):
    """Copies what was drawn; the block that shows it."""
    if not stage.figures:
        return {}
    made = place.folder(stage) / "figures"
    draw(experiment, stage, made)
    pictures.mkdir(parents=True, exist_ok=True)
    shown = []
    for name in stage.figures:
        if (made / f"{name}.png").is_file():
            shutil.copy(made / f"{name}.png", pictures / f"{stage.name}_{name}.png")
            title = (made / f"{name}.caption.txt").read_text(encoding="utf-8").split("\n", 1)[0]
            shown.append([title, f"images/evidence/{stage.name}_{name}.png"])
    return {"figures": {"figures": shown}}


def age(stage, revision, root):
    return data.age(revision, root) if stage.needs != stages.NOTHING and data.knows_history(root) else ""


def source(place, stage, status, root):
    """What captions say."""
    start, end = status["start"], status["end"]
    clocks = [f"SM {'/'.join(start['sm_mhz'])} MHz at the start, {'/'.join(end['sm_mhz'])} at the end"] if start["sm_mhz"] else []
    card = f"{status['devices']} {status['card']} of one host" if status["devices"] > 1 and stage.needs == stages.DEVICES else status["card"]
    return {"revision": status["revision"], "card": card, "driver": status["driver"], "date": start["date"].split(" ")[0],
            "conditions": [] if stage.needs == stages.NOTHING else [*clocks, f"load {start['load']:g} before, {end['load']:g} after"], "commands": status["commands"],
            "missing": status.get("missing", []), "quick": status["quick"], "old": age(stage, status["revision"], root)}


def collect(place, stage, root, pictures):
    """What docs/data holds of a stage that is done."""
    status = run.status(place, stage)
    if stage.experiment:
        results = experiments.load(place.folder(stage) / "results")
        spread = json.loads((place.folder(stage) / "spread.json").read_text())
        made = blocks(results, stage, spread) | figures(results, place, stage, pictures)
    elif stage.name == "claims":
        from ambilux.analysis.claims import evaluate, page, registry
        outcomes = [evaluate.outcome(c, place.folder(stage) / "results") for c in registry.load(root / "experiments/claims")]
        made = {o.claim.name: page.stored(o, pictures) for o in outcomes}
    else:
        files = [file for file in sorted(place.folder(stage).glob("*.json")) if file.name != "stage.json"]
        order = {part["file"]: i for i, part in enumerate(stage.parts(place))}
        # Parts of scenes that are not on this machine have no place in `order`.
        made = stage.tables([json.loads(f.read_text()) for f in sorted(files, key=lambda f: order.get(f.name, len(order)))])
    return {"source": source(place, stage, status, root), "blocks": made}
