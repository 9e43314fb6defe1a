"""Efficiency 1 / (error * time) of a run, with all pixels and the arithmetic mean, over seeds and over batches of passes.

The efficiency of an estimator is 1 / (variance * time) (Pharr, Jakob and Humphreys 2023, PBRT 4th ed., section 2.2); relMSE or MSE stands for the variance.
"""

import math
from dataclasses import dataclass

import numpy as np

from analysis import heavy_tails

ERRORS = {"relmse": "relative_error", "mse": "mse"}  # attribute of a Row, by metric
NAMES = {"relmse": "relMSE", "mse": "MSE"}


@dataclass(frozen=True)
class Work:
    """What a run pays for its error: rows of (error, time) whose means' product it is, one for each independent unit."""

    rows: np.ndarray
    over: str  # "seeds" or "batches"
    doubt: str  # of intervals


def few_pixels(rows):
    """For each row relMSE over relMSE without the worst pixels; NaN where it was not recorded."""
    return [r.relative_error / r.trimmed_error if r.trimmed_error > 0 else math.nan for r in rows]


def of_seeds(rows, metric):
    """Work of the rows of one checkpoint, one per seed."""
    pairs = [(getattr(r, ERRORS[metric]), r.time) for r in rows]
    good = [(e, t) for e, t in pairs if math.isfinite(e)]
    return Work(np.array(good).reshape(-1, 2), "seeds", heavy_tails.doubt_of_seeds([e for e, _ in good], few_pixels(rows)))


def batches_of(experiment, scene, run):
    """{seed: batches}, without those that are short of half the usual number of samples, such as before an early checkpoint: their tails are heavier."""
    every = experiment.batches_of(scene, run)
    usual = np.median([b.spp for of_seed in every.values() for b in of_seed]) if every else 0
    return {seed: kept for seed, of_seed in every.items() if (kept := [b for b in of_seed if b.spp >= usual / 2])}


def variances(batches, metric):
    """For each seed its batches' error * samples: estimates of one sample's error, whatever the batch's size."""
    return [[getattr(b, metric) * b.spp for b in of_seed] for of_seed in batches.values()]


def wholes(experiment, scene, run, batches, metric):
    """For each seed of `batches` the error * samples of its last image, which holds all of them."""
    last = {r.seed: r for r in sorted(experiment.select(scene, run), key=lambda r: r.spp)}
    return [getattr(last[seed], ERRORS[metric]) * last[seed].spp for seed in batches if seed in last]


def selection(experiment, scene, run, rows):
    """{seed: seconds of one sample that went into selecting a method (bdpt.auto), which no batch holds}, up to the checkpoint of `rows`."""
    samples = {r.seed: r.spp for r in rows}
    seconds = {seed: (stats.get("choice") or {}).get("seconds", 0.0) for seed, stats in experiment.stats_by_seed(scene, run).items()}
    return {seed: s / samples[seed] for seed, s in seconds.items() if s and seed in samples}


def of_batches(experiment, scene, run, metric, rows):
    """Work of a run's batches: (error of one sample, seconds of one sample) of each; None without batches. `rows`: of the checkpoint at which runs compare."""
    batches = batches_of(experiment, scene, run)
    if not batches:
        return None
    values = variances(batches, metric)
    before = selection(experiment, scene, run, rows)
    times = [b.time / b.spp + before.get(b.seed, 0.0) for of_seed in batches.values() for b in of_seed]
    return Work(np.array([*zip((v for of_seed in values for v in of_seed), times)]), "batches", heavy_tails.doubt_of_batches(values, wholes(experiment, scene, run, batches, metric)))


def averaging(experiment, scene, run, metric):
    """heavy_tails.averaging of a run's batches; NaN without."""
    batches = batches_of(experiment, scene, run)
    return heavy_tails.averaging(variances(batches, metric), wholes(experiment, scene, run, batches, metric)) if batches else math.nan


def judged(signed, over, doubt, for_test=False):
    """heavy_tails.estimate of [(sign, Work)], or a doubt where errors are not positive. for_test: its p alone is wanted, which needs no resamples."""
    units = min(len(w.rows) for _, w in signed)
    if units == 0 or any(not np.isfinite(w.rows).all() or not (w.rows.mean(axis=0) > 0).all() for _, w in signed):
        return heavy_tails.unknown(math.nan, over, units, "errors below the reference's noise" if units else "no results")
    resample = not for_test and (over == "batches" or units >= heavy_tails.FEWEST_RESAMPLED_SEEDS)
    return heavy_tails.estimate([(sign, w.rows) for sign, w in signed], over, doubt, resample)


def efficiency(work):
    """Judged of 1 / (mean error * mean time)."""
    return judged([(-1, work)], work.over, work.doubt)


def ratio(work, base, name, for_test=False):
    """Judged of the efficiency over that of `base`, another Work over the same kind of units; `name`: of the base, for its doubt."""
    return judged([(-1, work), (1, base)], work.over, work.doubt or (base.doubt and f"{name}: {base.doubt}"), for_test)


def mean_over_seeds(values, few=()):
    """Judged of the arithmetic mean of positive values over seeds. `few`: few_pixels of the same rows."""
    good = np.array([v for v in values if math.isfinite(v)])
    work = Work(good.reshape(-1, 1), "seeds", heavy_tails.doubt_of_seeds(good, few))
    return judged([(1, work)], "seeds", work.doubt) if len(good) and good.mean() > 0 else heavy_tails.unknown(
        float(good.mean()) if len(good) else math.nan, "seeds", len(good), work.doubt or "no results")


def root(j):
    """Judged of the square root: RMSE of MSE, whose mean over seeds is the arithmetic one."""
    return heavy_tails.Judged(math.sqrt(j.value) if j.value >= 0 else math.nan, *(math.sqrt(x) if x >= 0 else math.nan for x in (j.low, j.high)), j.p, j.over, j.units, j.doubt)


def lead(over_batches, over_seeds):
    """Which of both is shown first: that of more units, if its interval is to be trusted."""
    if over_batches is None:
        return over_seeds
    return over_seeds if not over_batches.trusted and over_seeds is not None and over_seeds.trusted else over_batches
