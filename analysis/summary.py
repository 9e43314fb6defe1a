"""From rows to what figures and tables show: curves over checkpoints and one line per (scene, run)."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from analysis import statistics


@dataclass(frozen=True)
class Curve:
    """Error of one run over its checkpoints, in rising order. Arrays of equal length; error is the geometric mean over seeds."""

    run: str
    seconds: np.ndarray
    spp: np.ndarray
    error: np.ndarray
    low: np.ndarray   # least seed
    high: np.ndarray  # greatest seed
    seeds: int


@dataclass(frozen=True)
class Line:
    """One run in one scene at the last checkpoint that all runs have. Means over seeds are geometric unless said otherwise."""

    scene: str
    run: str
    seeds: int
    spp: float
    seconds: float           # arithmetic mean
    rmse: float              # as Row.error
    relmse: float            # as Row.relative_error
    relmse_low: float        # least and greatest seed
    relmse_high: float
    mape: float
    rays_per_second: float
    efficiency: float        # 1 / (relMSE * seconds)
    speedup: statistics.Estimate | None  # over the first run, from seeds that both have
    slope: statistics.Estimate | None    # of log RMSE against log seconds, over all checkpoints
    bias_z: float            # greatest |z| over seeds of "the mean differs from the reference's"
    invalid: int             # dropped values, all seeds


def positive(values):
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values) & (values > 0)]


def mean_or_nan(values):
    """Geometric mean of those values that a logarithmic axis can show; NaN without one."""
    good = positive(values)
    return statistics.geometric_mean(good) if len(good) else math.nan


def curve(experiment, scene, run):
    """Curve of one run, or None without a point. Checkpoints whose error is zero or unknown for all seeds are left out."""
    points = []
    for checkpoint in experiment.checkpoints(scene, run):
        rows = experiment.select(scene, run, checkpoint)
        errors = positive([r.error for r in rows])
        if len(errors):
            points.append((mean_or_nan([r.time for r in rows]), mean_or_nan([r.spp for r in rows]), mean_or_nan(errors), errors.min(), errors.max()))
    return Curve(run, *np.array(points).T, len(experiment.seeds(scene, run))) if points else None


def reference_noise(experiment, scene):
    """RMS standard error of the scene's reference as the runner recorded it, or NaN."""
    return next((r.reference_noise for r in experiment.rows if r.scene == scene), math.nan)


def work(row):
    """relMSE * seconds: what a run pays for its error. Its inverse is the efficiency of an estimator, 1 / (variance * time) (Pharr, Jakob and
    Humphreys 2023, PBRT 4th ed., section 2.2), with relMSE in place of the variance."""
    return row.relative_error * row.time


def lines(experiment):
    """One Line per (scene, run), runs in the order of runs.csv. Speed-ups compare with the first run."""
    result = []
    for scene in experiment.scenes:
        last = experiment.last_common_checkpoint(scene)
        if last is None:
            continue
        first = {r.seed: work(r) for r in experiment.select(scene, experiment.runs[0], last)}
        for run in experiment.runs:
            rows = experiment.select(scene, run, last)
            if not rows:
                continue
            own = {r.seed: work(r) for r in rows}
            both = [s for s in own if s in first and math.isfinite(own[s] * first[s]) and own[s] * first[s] > 0]
            history = [[r for r in experiment.select(scene, run) if r.seed == seed] for seed in experiment.seeds(scene, run)]
            relmse = positive([r.relative_error for r in rows])
            all_work = mean_or_nan(list(own.values()))
            result.append(Line(
                scene=scene, run=run, seeds=len(rows),
                spp=mean_or_nan([r.spp for r in rows]),
                seconds=float(np.mean([r.time for r in rows])),
                rmse=mean_or_nan([r.error for r in rows]),
                relmse=mean_or_nan(relmse),
                relmse_low=float(relmse.min()) if len(relmse) else math.nan,
                relmse_high=float(relmse.max()) if len(relmse) else math.nan,
                mape=mean_or_nan([r.mape for r in rows]),
                rays_per_second=float(sum(r.rays for r in rows) / sum(r.time for r in rows)),
                efficiency=1 / all_work,
                speedup=statistics.ratio_of_pairs([first[s] for s in both], [own[s] for s in both]) if both else None,
                slope=statistics.convergence_slope([([r.time for r in h], [r.error for r in h]) for h in history]),
                bias_z=max(abs(r.bias_z) for r in rows),
                invalid=sum(r.invalid for r in rows)))
    return result


def bias_threshold(tests, level=0.01):
    """|z| that exceeds chance at `level` over all tests together: two-sided normal quantile at level / tests (Bonferroni), which
    holds although tests against one reference are dependent."""
    return NormalDist().inv_cdf(1 - level / tests / 2)


def remarks(experiment, summary):
    """Sentences that a reader must know before believing the figures: gaps, dropped values, bias, references that are too noisy."""
    found = []
    for scene in experiment.scenes:
        every = {(s, c) for run in experiment.runs for s in experiment.seeds(scene, run) for c in experiment.checkpoints(scene, run)}
        if not every:
            found.append(f"{scene}: no results yet")
            continue
        for run in experiment.runs:
            have = {(r.seed, r.checkpoint) for r in experiment.select(scene, run)}
            if len(have) < len(every):
                found.append(f"{scene}, {run}: {len(have)} of {len(every)} checkpoints recorded; figures and table use what is there")
    threshold = bias_threshold(sum(line.seeds for line in summary)) if summary else math.inf
    for line in summary:
        place = f"{line.scene}, {line.run}"
        noise = reference_noise(experiment, line.scene)
        if line.invalid:
            found.append(f"{place}: {line.invalid} values were NaN, Inf or negative and were dropped")
        broken = sum(not math.isfinite(r.error) for r in experiment.select(line.scene, line.run))
        if broken:
            found.append(f"{place}: the error of {broken} checkpoints is NaN or infinite; they are left out of figures and means")
        if line.bias_z > threshold:
            found.append(f"{place}: the mean differs from the reference's by |z| = {line.bias_z:.1f}; chance stays below {threshold:.1f} (1 % over all tests)")
        if not line.rmse >= noise and not math.isnan(noise):
            found.append(f"{place}: the error is below the noise of the reference ({noise:.2g}) and so uncertain; a longer reference helps")
    return found
