"""Efficiency 1 / (error * time) of a run, with all pixels and the arithmetic mean, over seeds and over batches of passes.

The efficiency of an estimator is 1 / (variance * time) (Pharr, Jakob and Humphreys 2023, PBRT 4th ed., section 2.2); relMSE or MSE stands for the variance.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from ambilux.analysis import heavy_tails

ERRORS = {"relmse": "relative_error", "mse": "mse"}  # attribute of a Row, by metric
NAMES = {"relmse": "relMSE", "mse": "MSE"}


@dataclass(frozen=True)
class Work:
    """What a run pays for its error, the product of the means of what follows.

    Over seeds a unit is a row of (error, time). Over batches it is a row of (error) alone, and times are those of seeds: what slows a render down slows all of its batches down, so
    that only renders tell how far times can be trusted."""

    rows: np.ndarray
    over: str  # "seeds" or "batches"
    doubt: str  # of intervals
    seconds: dict | None = None  # {seed: seconds of a sample}, over batches


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
    seconds = {seed: (stats.get("selection") or {}).get("seconds", 0.0) for seed, stats in experiment.stats_by_seed(scene, run).items()}
    return {seed: s / samples[seed] for seed, s in seconds.items() if s and seed in samples}


def of_batches(experiment, scene, run, metric, rows):
    """Work of a run's batches: error of one sample of each, seconds of one sample of each seed; None without batches. `rows`: of the checkpoint at which runs compare."""
    batches = batches_of(experiment, scene, run)
    if not batches:
        return None
    values, methods = variances(batches, metric), experiment.methods(scene, run)
    before = selection(experiment, scene, run, rows)
    seconds = {seed: sum(b.time for b in of_seed) / sum(b.spp for b in of_seed) + before.get(seed, 0.0) for seed, of_seed in batches.items()}
    doubt = "seeds ran different methods" if len(methods) > 1 else heavy_tails.doubt_of_batches(
        values, wholes(experiment, scene, run, batches, metric), heavy_tails.SAME_METHOD if methods else heavy_tails.DIFFERENT)
    return Work(np.array([v for of_seed in values for v in of_seed]).reshape(-1, 1), "batches", doubt, seconds)


def time_factors(signed):
    """[heavy_tails.Factor] of the times of [(sign, Work)], of seeds. Seeds that both of two works have are pairs: a busy machine slows neighbours down together."""
    times = [(sign, w.seconds) for sign, w in signed if w.seconds is not None]
    common = set.intersection(*(set(t) for _, t in times)) if times else set()
    groups = [times] if len(times) > 1 and len(common) > 1 else [[t] for t in times]
    out = []
    for group in groups:
        seeds = sorted(common if len(group) > 1 else group[0][1])
        values = [(sign, np.array([t[seed] for seed in seeds])) for sign, t in group]
        influence = sum(sign * v / v.mean() for sign, v in values)
        out.append(heavy_tails.Factor(sum(sign * math.log(v.mean()) for sign, v in values), float(influence.std(ddof=1)) / math.sqrt(len(seeds)) if len(seeds) > 1 else 0.0,
                                      max(1, len(seeds) - 1)))
    return out


def averaging(experiment, scene, run, metric):
    """heavy_tails.averaging of a run's batches; NaN without."""
    batches = batches_of(experiment, scene, run)
    return heavy_tails.averaging(variances(batches, metric), wholes(experiment, scene, run, batches, metric)) if batches else math.nan


def judged(signed, over, doubt, for_test=False):
    """heavy_tails.estimate of [(sign, Work)], or a doubt where errors are not positive. for_test: its p alone is wanted, which needs no resamples."""
    units = min(len(w.rows) for _, w in signed)
    if units == 0 or any(not np.isfinite(w.rows).all() or not (w.rows.mean(axis=0) > 0).all() for _, w in signed):
        return heavy_tails.unknown(math.nan, over, units, "errors below the reference's noise" if units else "no results")
    if any(w.seconds is not None and len(w.seconds) < 2 for _, w in signed):
        doubt = doubt or "1 seed"
    resample = not for_test and (over == "batches" or units >= heavy_tails.FEWEST_RESAMPLED_SEEDS)
    return heavy_tails.estimate([(sign, w.rows) for sign, w in signed], over, doubt, resample, besides=time_factors(signed))


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
    """Which of both is shown first: that of more units whose interval is to be trusted. Of neither it is the value over seeds, which is that of the errors and times beside it (batches may have
    missed what the whole image shows), and the doubt about batches."""
    if over_batches is None or over_seeds is None:
        return over_seeds if over_batches is None else over_batches
    if over_batches.trusted or over_seeds.trusted:
        return over_batches if over_batches.trusted else over_seeds
    return replace(over_seeds, doubt=over_batches.doubt) if over_batches.doubt else over_seeds
