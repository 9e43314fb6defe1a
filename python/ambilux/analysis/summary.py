"""From rows to what figures and tables show: curves over checkpoints and one line per (scene, run)."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ambilux.analysis import bias, efficiency, equal_error, heavy_tails, same_estimator, statistics

# What a row offers as its error, by the name that the report and the command line use, and what it is called on an axis.
MEASURES = {"rmse": "error", "relmse": "relative_error", "relmse_trimmed": "trimmed_error"}
SLOPES = {"rmse": -0.5, "relmse": -1.0, "relmse_trimmed": -1.0}  # of independent samples, against the logarithm of the budget


@dataclass(frozen=True)
class Curve:
    """Error of one run over its checkpoints, by rising budget. Arrays of equal length; error is the arithmetic mean over seeds (of squares, for RMSE), low and
    high the ends of its 95 % interval over seeds, NaN where it is not to be trusted (heavy_tails.py)."""

    run: str
    seconds: np.ndarray
    spp: np.ndarray
    error: np.ndarray
    low: np.ndarray
    high: np.ndarray
    seeds: int


@dataclass(frozen=True)
class Line:
    """One run in one scene at the last checkpoint that all runs have. Means over seeds are arithmetic (RMSE: root of the mean of squares)."""

    scene: str
    run: str
    seeds: int
    spp: float
    seconds: float
    rmse: heavy_tails.Judged     # of Row.error
    relmse: heavy_tails.Judged   # of Row.relative_error
    trimmed: heavy_tails.Judged  # of Row.trimmed_error; NaN if it was not recorded
    few_pixels: float            # mean relMSE over mean trimmed relMSE; NaN if unknown
    mape: float
    flip: float              # mean over seeds and pixels of HDR-FLIP; NaN if it was not computed
    flip_median: float       # mean over seeds of the median over pixels
    rays_per_second: float
    work_seeds: efficiency.Work          # of the metric that leads
    work_batches: efficiency.Work | None
    averaging: float                     # heavy_tails.averaging; NaN without batches
    ratio_seeds: heavy_tails.Judged | None    # of efficiencies, over the base run's
    ratio_batches: heavy_tails.Judged | None
    time_per_sample: float               # seconds of a sample of every pixel, mean over seeds
    ratio_time: heavy_tails.Judged | None  # of times per sample, if the run is the base run's estimator (same_estimator.py)
    speedup: equal_error.Speedup | None  # over the base run at equal RMSE, over all checkpoints
    slope: statistics.Estimate | None       # of log RMSE against log spp
    slope_time: statistics.Estimate | None  # of log RMSE against log seconds
    slope_seeds: int
    bias: bias.BiasTest | None
    reference_error: float   # bound of the standard error of the reference's mean; NaN if unknown
    bias_z: float            # greatest |z| over seeds of "the mean differs from the reference's"
    invalid: int             # dropped values, all seeds
    methods: dict            # Experiment.methods
    stated_bias: str         # what the method says of its bias; empty: it has none

    @cached_property
    def efficiency_seeds(self):
        return efficiency.efficiency(self.work_seeds)

    @cached_property
    def efficiency_batches(self):
        return efficiency.efficiency(self.work_batches) if self.work_batches else None

    @cached_property
    def efficiency(self):
        return efficiency.lead(self.efficiency_batches, self.efficiency_seeds)

    @cached_property
    def ratio(self):
        """What the table shows first; None without a base run. Of one and the same estimator the ratio of times is that of efficiencies, without the noise of errors."""
        return self.ratio_time if self.ratio_time is not None else efficiency.lead(self.ratio_batches, self.ratio_seeds)


def mean_or_nan(values):
    """Arithmetic mean of the finite values; NaN without one."""
    good = [v for v in values if math.isfinite(v)]
    return float(np.mean(good)) if good else math.nan


def mean_error(rows, measure):
    """Judged of the mean over seeds of a measure."""
    values, few = [getattr(r, MEASURES[measure]) for r in rows], efficiency.few_pixels(rows)
    return efficiency.root(efficiency.mean_over_seeds([v**2 for v in values], few)) if measure == "rmse" else efficiency.mean_over_seeds(values, few)


def recorded(experiment):
    """Those of MEASURES that the experiment holds, that of its metric first."""
    found = [m for m, name in MEASURES.items() if m != "relmse_trimmed" or any(not math.isnan(getattr(r, name)) for r in experiment.rows)]
    return sorted(found, key=lambda m: m != ("relmse" if experiment.metric == "relmse" else "rmse"))


def curve(experiment, scene, run, measure="rmse", x="seconds"):
    """Curve of one run over its checkpoints in `x`, "seconds" or "spp" (over all, if the experiment has one kind), or None without a point. Checkpoints
    whose error is zero or unknown for all seeds are left out."""
    points = []
    for checkpoint in experiment.checkpoints(scene, run, experiment.budget(x)):
        rows = experiment.select(scene, run, checkpoint)
        error = mean_error(rows, measure)
        if error.value > 0:
            points.append((mean_or_nan([r.time for r in rows]), mean_or_nan([r.spp for r in rows]), error.value, error.low, error.high))
    points.sort(key=lambda p: p[0 if x == "seconds" else 1])
    return Curve(run, *np.array(points).T, len(experiment.seeds(scene, run))) if points else None


def reference_noise(experiment, scene):
    """RMS standard error of the scene's reference as the runner recorded it, or NaN."""
    return next((r.reference_noise for r in experiment.rows if r.scene == scene), math.nan)


def resolved(experiment, scene, run, x="spp"):
    """Checkpoints in `x` (of all, if the experiment has one kind) whose mean error is at least the reference's noise (all, if that is unknown). Below,
    the corrected error is the difference of two nearly equal numbers, and its logarithm is biased. Decided by the mean over seeds, so that no lucky
    seed is picked."""
    noise = reference_noise(experiment, scene)
    checkpoints = experiment.checkpoints(scene, run, experiment.budget(x))
    if math.isnan(noise):
        return checkpoints
    return [c for c in checkpoints if mean_error(experiment.select(scene, run, c), "rmse").value >= noise]


def slope(experiment, scene, run, x="spp"):
    """(statistics.convergence_slope against `x`, "spp" or "seconds", over the resolved checkpoints in x or None, number of seeds)."""
    good = set(resolved(experiment, scene, run, x))
    budget = "time" if x == "seconds" else x
    rows = [[r for r in experiment.select(scene, run) if r.seed == seed and r.checkpoint in good] for seed in experiment.seeds(scene, run)]
    fits = [([getattr(r, budget) for r in of_seed], [r.error for r in of_seed]) for of_seed in rows]
    return statistics.convergence_slope(fits), sum(statistics.convergence_slope([f]) is not None for f in fits)


def speedup(experiment, scene, run, base=None):
    """equal_error.speedup of a run over the base run, by wall-clock time. None if a scene lacks either, or an error is below the noise of the reference."""
    names = (base or experiment.base, run)
    curves = [curve(experiment, scene, name) for name in names]
    last = experiment.last_common_checkpoint(scene)
    at_last = [mean_error(experiment.select(scene, name, last), "rmse") for name in names] if last is not None else []
    if not all(curves) or any(e.value <= 0 for e in at_last):
        return None
    doubts = [e.doubt for e in at_last]
    return replace(found, doubt=next(filter(None, doubts), "")) if (found := equal_error.speedup(*((c.seconds, c.error) for c in curves))) else None


def works(experiment, scene, run, checkpoint):
    """(Work over batches or None, Work over seeds at one checkpoint) of the metric that leads."""
    rows = experiment.select(scene, run, checkpoint)
    return efficiency.of_batches(experiment, scene, run, experiment.metric, rows), efficiency.of_seeds(rows, experiment.metric)


def ratios(of_run, of_base, name, for_test=False):
    """(ratio of efficiencies over batches, over seeds) of two pairs of works; None for what either lacks."""
    return [efficiency.ratio(a, b, name, for_test) if a is not None and b is not None and len(a.rows) and len(b.rows) else None for a, b in zip(of_run, of_base)]


def time_ratio(experiment, scene, run, base):
    """same_estimator.time_ratio of a run that is the estimator of `base`; None of another, and of `base` itself."""
    return same_estimator.time_ratio(experiment, scene, run, base) if run != base and same_estimator.same(experiment, scene, run, base) else None


def ratio_over(experiment, scene, run, base):
    """What Line.ratio is, over any run `base`, at the last checkpoint that all runs have."""
    last = experiment.last_common_checkpoint(scene)
    of_run, of_base = (works(experiment, scene, name, last) for name in (run, base))
    return time_ratio(experiment, scene, run, base) or efficiency.lead(*ratios(of_run, of_base, base))


def line(experiment, scene, run, checkpoint):
    """The Line of a run with results at the checkpoint."""
    rows = experiment.select(scene, run, checkpoint)
    slope_spp, slope_seeds = slope(experiment, scene, run)
    reference_error = bias.reference_mean_error(reference_noise(experiment, scene), experiment.pixels(scene))
    of_batches, of_seeds = works(experiment, scene, run, checkpoint)
    ratio_batches, ratio_seeds = ratios((of_batches, of_seeds), works(experiment, scene, experiment.base, checkpoint), experiment.base)
    relmse, trimmed = mean_error(rows, "relmse"), mean_error(rows, "relmse_trimmed")
    return Line(
        scene=scene, run=run, seeds=len(rows), spp=mean_or_nan([r.spp for r in rows]), seconds=mean_or_nan([r.time for r in rows]),
        rmse=mean_error(rows, "rmse"), relmse=relmse, trimmed=trimmed,
        few_pixels=relmse.value / trimmed.value if trimmed.value > 0 else math.nan,
        mape=mean_or_nan([r.mape for r in rows]), flip=math.nan, flip_median=math.nan,
        rays_per_second=float(sum(r.rays for r in rows) / sum(r.time for r in rows)),
        work_seeds=of_seeds, work_batches=of_batches, averaging=efficiency.averaging(experiment, scene, run, experiment.metric),
        ratio_seeds=ratio_seeds, ratio_batches=ratio_batches,
        time_per_sample=mean_or_nan(list(same_estimator.seconds_per_sample(experiment, scene, run).values())),
        ratio_time=time_ratio(experiment, scene, run, experiment.base),
        speedup=speedup(experiment, scene, run) if experiment.select(scene, experiment.base, checkpoint) else None,
        slope=slope_spp, slope_time=slope(experiment, scene, run, "seconds")[0], slope_seeds=slope_seeds,
        bias=bias.bias_test([r.bias for r in rows], reference_error, [r.bias_z for r in rows]),
        reference_error=reference_error, bias_z=max(abs(r.bias_z) for r in rows), invalid=sum(r.invalid for r in rows), methods=experiment.methods(scene, run),
        stated_bias=rows[0].stated_bias)


def lines(experiment, flips=None, apart=None):
    """One Line per (scene, run), in the order of the configuration. flips: {(scene, run): (mean, median)} of HDR-FLIP. apart(scene, run)(make) is make(), or
    None where that fails; without it failures are thrown."""
    if "lines" not in experiment.kept:
        last = {scene: experiment.last_common_checkpoint(scene) for scene in experiment.scenes}
        made = ((apart(scene, run) if apart else lambda make: make())(lambda scene=scene, run=run: line(experiment, scene, run, last[scene]))
                for scene in experiment.scenes if last[scene] is not None for run in experiment.runs if experiment.select(scene, run, last[scene]))
        experiment.kept["lines"] = [x for x in made if x is not None]
    found = experiment.kept["lines"]
    return [replace(x, flip=flips[x.scene, x.run][0], flip_median=flips[x.scene, x.run][1]) if (x.scene, x.run) in flips else x for x in found] if flips else found


def equal(experiment):
    """What runs have alike where the table compares them: "time" or "samples"."""
    kinds = experiment.budgets - {""} or set(experiment.manifest.get("checkpoints") or {})
    return "samples" if kinds == {"spp"} else "time"


def rows_used(experiment):
    """A sentence on which rows stand for what."""
    if experiment.budget("spp"):
        return ("Time axes, speed-ups, the table's errors and bias use the checkpoints in seconds (budget \"seconds\" of runs.csv), axes in samples and slopes against "
                "samples those in samples (budget \"spp\").")
    kind = next(iter(experiment.budgets), "")
    named = {"spp": "in samples", "seconds": "in seconds"}.get(kind, "of one kind")
    return f"All axes, speed-ups and slopes use all checkpoints, which are {named}; the table's errors and bias use the last one that all runs have reached."
