"""From rows to what figures and tables show: curves over checkpoints and one line per (scene, run)."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from analysis import bias, equal_error, statistics

# What a row offers as its error, by the name that the report and the command line use, and what it is called on an axis.
MEASURES = {"rmse": "error", "relmse": "relative_error", "relmse_trimmed": "trimmed_error"}
SLOPES = {"rmse": -0.5, "relmse": -1.0, "relmse_trimmed": -1.0}  # of independent samples, against the logarithm of the budget
FAR = 4.0  # extrapolating a time by more than this is told
FEW_PIXELS = 2.0  # relMSE over relMSE without the worst pixels, from which on these hold more than half of it
SLOW_CLOCK = 1.1  # ratio of clocks at start and end of an experiment that is told


@dataclass(frozen=True)
class Curve:
    """Error of one run over its checkpoints, by rising budget. Arrays of equal length; error is the geometric mean over seeds, low and high
    the ends of its 95 % confidence interval (statistics.geometric_estimate), NaN with one seed."""

    run: str
    seconds: np.ndarray
    spp: np.ndarray
    error: np.ndarray
    low: np.ndarray
    high: np.ndarray
    seeds: int


@dataclass(frozen=True)
class Line:
    """One run in one scene at the last checkpoint that all runs have. Means over seeds are geometric unless said otherwise."""

    scene: str
    run: str
    seeds: int
    spp: float
    seconds: float           # arithmetic mean
    rmse: statistics.Estimate    # as Row.error
    relmse: statistics.Estimate  # as Row.relative_error
    trimmed: statistics.Estimate  # as Row.trimmed_error; NaN if it was not recorded
    few_pixels: statistics.Estimate | None  # relMSE over trimmed relMSE of the same seed
    mape: float
    rays_per_second: float
    efficiency: statistics.Estimate  # 1 / (relMSE * seconds)
    gain: statistics.Estimate | None     # ratio of efficiencies to the base run, from seeds that both have
    speedup: equal_error.Speedup | None  # over the base run at equal RMSE, over all checkpoints
    slope: statistics.Estimate | None       # of log RMSE against log spp
    slope_time: statistics.Estimate | None  # of log RMSE against log seconds
    slope_seeds: int
    bias: bias.BiasTest | None
    reference_error: float   # bound of the standard error of the reference's mean; NaN if unknown
    bias_z: float            # greatest |z| over seeds of "the mean differs from the reference's"
    invalid: int             # dropped values, all seeds


def positive(values):
    values = np.asarray(values, dtype=float)
    return values[np.isfinite(values) & (values > 0)]


def mean_or_nan(values):
    """Geometric mean of those values that a logarithmic axis can show; NaN without one."""
    good = positive(values)
    return statistics.geometric_mean(good) if len(good) else math.nan


def estimate_or_nan(values):
    """Likewise with its interval."""
    good = positive(values)
    return statistics.geometric_estimate(good) if len(good) else statistics.Estimate(*[math.nan] * 4)


def recorded(experiment):
    """Those of MEASURES that the experiment holds."""
    return [m for m, name in MEASURES.items() if m != "relmse_trimmed" or any(not math.isnan(getattr(r, name)) for r in experiment.rows)]


def curve(experiment, scene, run, measure="rmse", x="seconds"):
    """Curve of one run over its checkpoints in `x`, "seconds" or "spp" (over all, if the experiment has one kind), or None without a point. Checkpoints
    whose error is zero or unknown for all seeds are left out."""
    points = []
    for checkpoint in experiment.checkpoints(scene, run, experiment.budget(x)):
        rows = experiment.select(scene, run, checkpoint)
        error = estimate_or_nan([getattr(r, MEASURES[measure]) for r in rows])
        if not math.isnan(error.value):
            points.append((mean_or_nan([r.time for r in rows]), mean_or_nan([r.spp for r in rows]), error.value, error.low, error.high))
    points.sort(key=lambda p: p[0 if x == "seconds" else 1])
    return Curve(run, *np.array(points).T, len(experiment.seeds(scene, run))) if points else None


def reference_noise(experiment, scene):
    """RMS standard error of the scene's reference as the runner recorded it, or NaN."""
    return next((r.reference_noise for r in experiment.rows if r.scene == scene), math.nan)


def work(row):
    """relMSE * seconds: what a run pays for its error. Its inverse is the efficiency of an estimator, 1 / (variance * time) (Pharr, Jakob and
    Humphreys 2023, PBRT 4th ed., section 2.2), with relMSE in place of the variance."""
    return row.relative_error * row.time


def series(experiment, scene, run, measure="rmse"):
    """{seed: (seconds, errors)} over the checkpoints in seconds (over all, if the experiment has one kind)."""
    out = {}
    for r in experiment.select(scene, run, budget=experiment.budget("seconds")):
        pair = out.setdefault(r.seed, ([], []))
        pair[0].append(r.time)
        pair[1].append(getattr(r, MEASURES[measure]))
    return out


def resolved(experiment, scene, run, x="spp"):
    """Checkpoints in `x` (of all, if the experiment has one kind) whose mean error is at least the reference's noise (all, if that is unknown). Below,
    the corrected error is the difference of two nearly equal numbers, and its logarithm is biased. Decided by the mean over seeds, so that no lucky
    seed is picked."""
    noise = reference_noise(experiment, scene)
    checkpoints = experiment.checkpoints(scene, run, experiment.budget(x))
    if math.isnan(noise):
        return checkpoints
    return [c for c in checkpoints if mean_or_nan([r.error for r in experiment.select(scene, run, c)]) >= noise]


def slope(experiment, scene, run, x="spp"):
    """(statistics.convergence_slope against `x`, "spp" or "seconds", over the resolved checkpoints in x or None, number of seeds)."""
    good = set(resolved(experiment, scene, run, x))
    budget = "time" if x == "seconds" else x
    rows = [[r for r in experiment.select(scene, run) if r.seed == seed and r.checkpoint in good] for seed in experiment.seeds(scene, run)]
    fits = [([getattr(r, budget) for r in of_seed], [r.error for r in of_seed]) for of_seed in rows]
    return statistics.convergence_slope(fits), sum(statistics.convergence_slope([f]) is not None for f in fits)


def speedup(experiment, scene, run, base=None):
    """equal_error.speedup of a run over the base run, by wall-clock time. None if a scene lacks either."""
    return equal_error.speedup(series(experiment, scene, base or experiment.base), series(experiment, scene, run))


def gain(rows, base_rows):
    """Ratio of efficiencies at one checkpoint, from seeds that both have; None without one."""
    own, base = ({r.seed: work(r) for r in some} for some in (rows, base_rows))
    both = [s for s in own if s in base and math.isfinite(own[s] * base[s]) and own[s] * base[s] > 0]
    return statistics.ratio_of_pairs([base[s] for s in both], [own[s] for s in both]) if both else None


def few_pixels(rows):
    """relMSE over relMSE without the worst pixels, geometric mean over seeds; None if unknown. At 2 these pixels hold half of relMSE, at 10 nine tenths."""
    pairs = [(r.relative_error, r.trimmed_error) for r in rows if r.relative_error > 0 and r.trimmed_error > 0]
    return statistics.ratio_of_pairs(*zip(*pairs)) if pairs else None


def lines(experiment):
    """One Line per (scene, run), in the order of the configuration."""
    result = []
    for scene in experiment.scenes:
        last = experiment.last_common_checkpoint(scene)
        if last is None:
            continue
        base = experiment.select(scene, experiment.base, last)
        for run in experiment.runs:
            rows = experiment.select(scene, run, last)
            if not rows:
                continue
            slope_spp, slope_seeds = slope(experiment, scene, run)
            reference_error = bias.reference_mean_error(reference_noise(experiment, scene), experiment.pixels(scene))
            result.append(Line(
                scene=scene, run=run, seeds=len(rows),
                spp=mean_or_nan([r.spp for r in rows]),
                seconds=float(np.mean([r.time for r in rows])),
                rmse=estimate_or_nan([r.error for r in rows]),
                relmse=estimate_or_nan([r.relative_error for r in rows]),
                trimmed=estimate_or_nan([r.trimmed_error for r in rows]),
                few_pixels=few_pixels(rows),
                mape=mean_or_nan([r.mape for r in rows]),
                rays_per_second=float(sum(r.rays for r in rows) / sum(r.time for r in rows)),
                efficiency=estimate_or_nan([1 / work(r) for r in rows if work(r) > 0]),
                gain=gain(rows, base),
                speedup=speedup(experiment, scene, run) if base else None,
                slope=slope_spp,
                slope_time=slope(experiment, scene, run, "seconds")[0],
                slope_seeds=slope_seeds,
                bias=bias.bias_test([r.bias for r in rows], reference_error, [r.bias_z for r in rows]),
                reference_error=reference_error,
                bias_z=max(abs(r.bias_z) for r in rows),
                invalid=sum(r.invalid for r in rows)))
    return result


LEVEL = 0.01  # chance of a false statement over all tests of one kind together


def bias_threshold(tests, level=LEVEL):
    """|z| that exceeds chance at `level` over all tests together: two-sided normal quantile at level / tests (Bonferroni), which
    holds although tests against one reference are dependent."""
    return NormalDist().inv_cdf(1 - level / tests / 2)


def is_biased(line, lines):
    """Whether the means of single seeds or the mean over seeds differ from the reference's by more than chance at LEVEL over all lines."""
    return line.bias_z > bias_threshold(sum(x.seeds for x in lines)) or (line.bias is not None and line.bias.p < LEVEL / len(lines))


def biased(lines):
    """{(scene, run)} of those."""
    return {(line.scene, line.run) for line in lines if is_biased(line, lines)}


def marks(speedup, biased):
    """What stands after a speed-up that is not to be taken at its word: * for extrapolated times, † if it compares with an error that bias keeps up."""
    return ("*" if speedup.extrapolated > FAR else "") + ("†" if biased else "")


def slope_p(line):
    """Chance of a slope as far from -1/2; NaN with less than two seeds."""
    return math.nan if line.slope is None else statistics.two_sided_p(line.slope.value, line.slope.error, SLOPES["rmse"], line.slope_seeds)


def verdicts(lines):
    """What the data say on slope and bias, in whole sentences, for (scene, run). Bonferroni over the lines: LEVEL / number of them."""
    out = {}
    for line in lines:
        p = slope_p(line)
        limit = LEVEL / max(1, len(lines))
        if math.isnan(p):
            slope_said = "slope: not tested (needs two seeds and two checkpoints above the noise of the reference)"
        else:
            slope_said = (f"slope {line.slope.value:.3f} [{line.slope.low:.3f}, {line.slope.high:.3f}]: "
                          + ("differs from −1/2 by more than chance" if p < limit else "no departure from −1/2 found"))
        if line.bias is None:
            bias_said = "bias over seeds: not tested (needs two seeds)"
        else:
            e = line.bias.estimate
            known = "" if math.isfinite(line.reference_error) else " (the noise of the reference is unknown and counts as none)"
            bias_said = (f"mean off by {e.value:+.2e} [{e.low:+.1e}, {e.high:+.1e}]: "
                         + ("more than chance and the noise of the reference explain" if line.bias.p < limit else "no bias found") + known)
        out[line.scene, line.run] = (slope_said, bias_said)
    return out


def rows_used(experiment):
    """A sentence on which rows stand for what."""
    if experiment.budget("spp"):
        return ("Time axes, speed-ups, the table's errors and bias use the checkpoints in seconds (budget \"seconds\" of runs.csv), axes in samples and slopes against "
                "samples those in samples (budget \"spp\").")
    kind = next(iter(experiment.budgets), "")
    named = {"spp": "in samples", "seconds": "in seconds"}.get(kind, "of one kind")
    return f"All axes, speed-ups and slopes use all checkpoints, which are {named}; the table's errors and bias use the last one that all runs have reached."


def trimmed_share(experiment):
    """Text such as "0.1 %" of the pixels that trimmed relMSE leaves out."""
    share = experiment.manifest.get("trimmed_share")
    return f"{100 * share:g} %" if share else "few"


def trimmed_remarks(experiment, summary):
    """Scenes on which a handful of pixels decides relMSE, with the ratios, and whether they decide which run is best."""
    for scene in experiment.scenes:
        known = [line for line in summary if line.scene == scene and line.few_pixels]
        few = [line for line in known if line.few_pixels.value >= FEW_PIXELS]
        if not few:
            continue
        whole, trimmed = (min(known, key=lambda line: getattr(line, m).value).run for m in ("relmse", "trimmed"))
        better = f"; without them {trimmed} has the least error, with them {whole}" if whole != trimmed else ""
        few.sort(key=lambda line: -line.few_pixels.value)
        told = ", ".join(f"{line.run} {line.few_pixels.value:.3g}" for line in few[:4])
        more = f" and {len(few) - 4} more, down to {few[-1].few_pixels.value:.3g}" if len(few) > 4 else ""
        yield (f"{scene}: the worst {trimmed_share(experiment)} of the pixels hold more than half of relMSE, which is so many times the trimmed one: {told}{more}"
               f"{better}; state both")


def clock_readings(experiment):
    """[(when, {name: MHz})] of the manifest: "CPU" is the mean over cores, "GPU 0" the SM clock of the first GPU."""
    out = []
    for entry in experiment.manifest.get("clocks") or []:
        mhz = {"CPU": (entry.get("cpu_mhz") or {}).get("mean")} | {f"GPU {i}": gpu.get("sm_mhz") for i, gpu in enumerate(entry.get("gpu") or [])}
        out.append((entry.get("when", "?"), {name: value for name, value in mhz.items() if value}))
    return out


def clock_text(experiment):
    """"CPU 2596 MHz at start, 2600 at end; GPU 0 (SM) 345 MHz at start, 1980 at end", or None."""
    readings = clock_readings(experiment)
    names = list(dict.fromkeys(name for _, mhz in readings for name in mhz))
    def told(name):
        values = [f"{mhz[name]:.0f} MHz ({when})" for when, mhz in readings if name in mhz]
        return f"{name}{' SM' if name.startswith('GPU') else ''} " + ", ".join(values)
    return "; ".join(told(name) for name in names) or None


def clock_remarks(experiment):
    """Clocks that were another at the end than at the start."""
    readings = clock_readings(experiment)
    if len(readings) < 2:
        return
    (first, a), (last, b) = readings[0], readings[-1]
    for name in a.keys() & b.keys():
        if max(a[name], b[name]) > SLOW_CLOCK * min(a[name], b[name]):
            idle = " (an idle GPU shows low clocks before its first work)" if name.startswith("GPU") else ""
            yield (f"{name}: {a[name]:.0f} MHz at {first}, {b[name]:.0f} at {last}{idle}; times of early and late renders may not compare")


def remarks(experiment, summary):
    """Sentences that a reader must know before believing the figures: gaps, dropped values, bias, references that are too noisy, pixels that decide
    relMSE, clocks that changed."""
    found = list(clock_remarks(experiment))
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
        elif line.bias and line.bias.p < LEVEL / len(summary):
            found.append(f"{place}: the mean over seeds differs from the reference's by {line.bias.estimate.value:+.2e} ± {line.bias.estimate.error:.1e}, "
                         "noise of the reference included; chance does that in less than 1 % over all tests")
        if slope_p(line) < LEVEL / len(summary):
            found.append(f"{place}: the error falls with slope {line.slope.value:.3f} ± {line.slope.error:.3f} of samples, which is not the −1/2 of independent "
                         "samples without bias: look for bias, rare bright samples, or samples that are not independent")
        if not line.rmse.value >= noise and not math.isnan(noise):
            found.append(f"{place}: the error is below the noise of the reference ({noise:.2g}) and so uncertain; a longer reference helps")
        if line.speedup and line.speedup.extrapolated > FAR:
            found.append(f"{place}: the speed-up compares errors that only one run has measured; the other's time was extrapolated by a factor "
                         f"of {line.speedup.extrapolated:.3g} along slope −1/2")
    return found + list(trimmed_remarks(experiment, summary))
