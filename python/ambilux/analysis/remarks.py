"""Sentences that a reader must know before believing the figures: gaps, dropped values, bias, references that are too noisy, pixels that decide, clocks."""

import math
import re

from ambilux.analysis import experiment as experiments
from ambilux.analysis import fairness, images, peers, summary, verdicts

FEW_PIXELS = 2.0  # relMSE over relMSE without the worst pixels, from which on these hold more than half of it
ROUNDING = 1e-3
SLOW_CLOCK = 1.1  # ratio of clocks at start and end of an experiment that is told


def listed(places, most=6):
    return ", ".join(places[:most]) + (f" and {len(places) - most} more" if len(places) > most else "")


def trimmed_share(experiment):
    """Text such as "0.1 %" of the pixels that trimmed relMSE leaves out."""
    share = experiment.manifest.get("trimmed_share")
    return f"{100 * share:g} %" if share else "few"


def trimmed_remarks(experiment, lines):
    """Scenes on which a handful of pixels decides relMSE, with the ratios, and whether they decide which run is best."""
    for scene in experiment.scenes:
        known = [line for line in lines if line.scene == scene and line.few_pixels > 0]
        few = [line for line in known if line.few_pixels >= FEW_PIXELS]
        if not few:
            continue
        # Of errors that differ in rounding alone, the first run's.
        least = {m: min(getattr(line, m).value for line in known) for m in ("relmse", "trimmed")}
        whole, trimmed = (next(line.run for line in known if getattr(line, m).value <= least[m] * (1 + ROUNDING)) for m in least)
        better = f"; {trimmed} has the lowest trimmed relMSE, {whole} the lowest relMSE" if whole != trimmed else ""
        few.sort(key=lambda line: -line.few_pixels)
        told = ", ".join(f"{line.run} {line.few_pixels:.3g}" for line in few[:4])
        more = f" and {len(few) - 4} more, down to {few[-1].few_pixels:.3g}" if len(few) > 4 else ""
        yield (f"{scene}: the worst {trimmed_share(experiment)} of the pixels hold more than half of relMSE. relMSE over trimmed relMSE: {told}{more}"
               f"{better}. State both")


def method_remarks(experiment):
    """Runs whose seeds did not run the same method."""
    for scene in experiment.scenes:
        for run in experiment.runs:
            found = experiment.methods(scene, run)
            if len(found) > 1:
                told = "; ".join(f"{method} (seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))})" for method, seeds in found.items())
                yield f"{scene}, {run}: seeds ran different methods, so that their mean is that of a mixture: {told}"


def same_remarks(lines, experiment=None):
    """Runs that are the base run's estimator: what their time says. Those that set what the base run has anyway show how far the machine can be trusted."""
    for line in lines:
        r = line.ratio_time
        anyway = experiment is not None and sets_nothing(experiment, line.scene, line.run)
        if r is None:
            continue
        told = f"a sample takes {1 / r.value:.3g} times as long [{1 / r.high:.3g}, {1 / r.low:.3g}]"
        if not r.trusted:
            said = f"no time per sample is stated: {r.doubt}"
        elif verdicts.differs(line, lines):
            said = told
        elif r.low <= 1 <= r.high:
            said = f"no effect on the time per sample found (ratio {1 / r.value:.3g} [{1 / r.high:.3g}, {1 / r.low:.3g}])"
        else:
            said = f"{told}; 1 is outside of the interval, but {line.seeds} seeds are too few to claim a difference at the level of all statements"
        yield (f"{line.scene}, {line.run}: the same images at equal seeds as the base run; {said}"
               + ("; on this scene the setting equals the default, so that the difference shows the accuracy of the times" if anyway else ""))


def sets_nothing(experiment, scene, run):
    """Whether a run named like base[key=value] sets what the statistics of the base run have without it."""
    name, settings = experiments.settings_of(run)
    recorded = experiment.stats(scene, experiment.base) if name == experiment.base and settings else ()
    return bool(recorded) and all(str(stats.get(key)).lower() == value.lower() for stats in recorded for key, value in settings.items())


def doubt_remarks(lines):
    """Intervals that the table does not state, by reason."""
    reasons = {}
    for line in lines:
        if line.efficiency is not None and line.efficiency.doubt:
            found = reasons.setdefault(re.sub(r"^\d+ ", "", line.efficiency.doubt), {})
            found.setdefault(line.efficiency.doubt, []).append(f"{line.scene} {line.run}")
    for kind, found in reasons.items():
        places = [place for doubt in found for place in found[doubt]]
        counts = sorted(int(doubt.split()[0]) for doubt in found if doubt != kind)
        said = kind if not counts else (f"{counts[0]} {kind}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]} {kind}") + ", too few"
        yield f"no interval is stated for {listed(places, 6)}: {said}"


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
            yield (f"{name}: {a[name]:.0f} MHz at {first}, {b[name]:.0f} at {last}{idle}; times of early and late renders may not be comparable")


def stated_bias_remarks(lines):
    """Runs whose method says that it is biased, by what it says."""
    said = {}
    for line in lines:
        if line.stated_bias:
            said.setdefault(line.stated_bias, {})[line.run] = True
    for bias, runs in said.items():
        yield f"{listed(list(runs))}: {bias}, so that errors include this bias and need not fall with slope −1/2"


def has_black_reference(experiment, scene):
    try:
        return (path := experiment.reference(scene)) is not None and images.is_black(images.read_exr(path))
    except experiments.InputError:
        return False  # the figures tell


def remarks(experiment, lines):
    """Sentences that a reader must know before believing the figures: gaps, dropped values, bias, references that are too noisy, pixels that decide
    relMSE, clocks that changed."""
    found = [*clock_remarks(experiment), *fairness.remarks(experiment), *peers.remarks(experiment)]
    for scene in experiment.scenes:
        every = {(s, c) for run in experiment.runs for s in experiment.seeds(scene, run) for c in experiment.checkpoints(scene, run)}
        if not every:
            found.append(f"{scene}: no results yet")
            continue
        if has_black_reference(experiment, scene):
            found.append(f"{scene}: its reference is black, so that relative errors and FLIP are undefined: look for light that no path finds")
        for run in experiment.runs:
            have = {(r.seed, r.checkpoint) for r in experiment.select(scene, run)}
            if len(have) < len(every) and (have or not peers.is_left_out(experiment, scene, run)):
                found.append(f"{scene}, {run}: {len(have)} of {len(every)} checkpoints recorded; figures and table use what is there")
    found += stated_bias_remarks(lines)
    threshold, quiet = verdicts.bias_threshold(verdicts.family(lines)), {}
    for line in lines:
        place = f"{line.scene}, {line.run}"
        noise = summary.reference_noise(experiment, line.scene)
        if line.invalid:
            found.append(f"{place}: {line.invalid} values were NaN, Inf or negative and were dropped")
        broken = sum(not math.isfinite(r.error) for r in experiment.select(line.scene, line.run))
        if broken:
            found.append(f"{place}: the error of {broken} checkpoints is NaN or infinite; they are left out of figures and means")
        if line.bias_z > threshold:
            found.append(f"{place}: the mean differs from the reference's by |z| = {line.bias_z:.1f}; |z| above {threshold:.1f} occurs by chance in less than 1 % of reports")
        elif line.bias and line.bias.p < verdicts.limit(lines):
            found.append(f"{place}: the mean over seeds differs from the reference's by {line.bias.estimate.value:+.2e} ± {line.bias.estimate.error:.1e}, "
                         "noise of the reference included; chance does that in less than 1 % of reports")
        if not line.stated_bias and verdicts.slope_p(line) < verdicts.limit(lines):
            found.append(f"{place}: the error falls with slope {line.slope.value:.3f} ± {line.slope.error:.3f} instead of the −1/2 of independent, unbiased "
                         "samples: look for bias, rare bright samples, or dependent samples")
        if not line.rmse.value >= noise and not math.isnan(noise):
            quiet.setdefault(line.scene, []).append(line.run)
    for scene, runs in quiet.items():
        found.append(f"{scene}: the error of {listed(runs)} is below the noise of the reference ({summary.reference_noise(experiment, scene):.2g}) and therefore uncertain; use a longer reference")
    return found + list(method_remarks(experiment)) + list(same_remarks(lines, experiment)) + list(doubt_remarks(lines)) + list(trimmed_remarks(experiment, lines))
