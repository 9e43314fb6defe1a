"""Results as pandas frames: from ambilux.analysis import frames; frames.runs("out/convergence").

Each function takes a folder or what experiment.load returned. Columns: docs/analysis.md. The package pandas is needed for this module alone.
"""

import dataclasses
import io

import pandas

from ambilux.analysis import experiment, pyramid, summary, tables


def loaded(data):
    return data if isinstance(data, experiment.Experiment) else experiment.load(data)


def of_rows(rows, kind):
    return pandas.DataFrame([dataclasses.asdict(r) for r in rows], columns=[f.name for f in dataclasses.fields(kind)])


def runs(data):
    """runs.csv: a row per scene, run, seed and checkpoint."""
    return of_rows(loaded(data).rows, experiment.Row)


def batches(data):
    """batches.csv: a row per batch of passes; empty for results of older versions."""
    return of_rows(loaded(data).batches, experiment.Batch)


def table(data):
    """table.csv without FLIP: a row per scene and run, with efficiencies, ratios, intervals and why there are none."""
    text = tables.to_csv(summary.lines(loaded(data)))
    return pandas.read_csv(io.StringIO(text), keep_default_na=False, na_values=["nan"])


def renders(data):
    """(scene, run, seed, statistics) of every render."""
    data = loaded(data)
    for scene in data.scenes:
        for run in data.runs:
            for seed, path in data.files("stats", scene, run, ".json"):
                yield scene, run, seed, experiment.read_json(path)


def stages(data):
    """A row per scene, run, seed and stage: launches, items, seconds."""
    columns = ["scene", "run", "seed", "stage", "launches", "items", "seconds"]
    return pandas.DataFrame([(*key, s["name"], s.get("launches"), s.get("items"), s.get("seconds")) for *key, stats in renders(data) for s in stats.get("stages", ())],
                            columns=columns)


def depths(data):
    """A row per scene, run, seed, stage and depth: items."""
    return pandas.DataFrame([(*key, s["name"], depth, items) for *key, stats in renders(data) for s in stats.get("stages", ())
                             for depth, items in enumerate(s.get("items_by_depth", ()))], columns=["scene", "run", "seed", "stage", "depth", "items"])


def queues(data):
    """A row per scene, run, seed and queue: capacity, peak, overflow."""
    return pandas.DataFrame([(*key, q["name"], q.get("capacity"), q.get("peak"), q.get("overflow")) for *key, stats in renders(data) for q in stats.get("queues", ())],
                            columns=["scene", "run", "seed", "queue", "capacity", "peak", "overflow"])


def selections(data):
    """A row per scene, run, seed and candidate of bdpt.auto: what it predicted and timed, and which one ran (`chosen`)."""
    columns = ["scene", "run", "seed", "candidate", "chosen", "variance", "work", "seconds_per_sample", "efficiency", "excluded"]
    rows = []
    for scene, run, seed, stats in renders(data):
        selection = stats.get("selection") or {}
        for c in selection.get("candidates", ()):
            rows.append((scene, run, seed, c["name"], c["name"] == selection["name"], *(c.get(k) for k in columns[5:])))
    return pandas.DataFrame(rows, columns=columns)


def strategies(data):
    """A row per scene, run and strategy (s,t): variance of a sample, its interval, its share of all, the share of its greatest pixel."""
    data = loaded(data)
    rows = [(scene, run, *strategy, e.value, e.low, e.high, share, seeds, pixel) for scene in data.scenes for run in data.runs
            for strategy, e, share, seeds, pixel in pyramid.variances(data, scene, run)]
    return pandas.DataFrame(rows, columns=["scene", "run", "s", "t", "merge", "variance", "variance_low", "variance_high", "share", "seeds", "largest_pixel"])
