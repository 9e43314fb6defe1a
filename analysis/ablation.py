"""Ablation: one switch at a time against a default run, as bars of speed-up at equal error with intervals; sweeps as lines."""

import math

import matplotlib.pyplot as plt
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from analysis import equal_error, experiment as experiments, style, summary

WIDEST_INTERVAL = 30.0  # bars of two seeds can have intervals over decades; the axis shows this much beyond the values


def label(run, base):
    """A run of a sweep over the base run by what differs."""
    name, settings = experiments.settings_of(run)
    short = ", ".join(f"{k} = {v}" for k, v in settings.items())
    return short if settings and name == experiments.settings_of(base)[0] else run


def ratio_ticks(low, high):
    """Ticks of a logarithmic axis of ratios, few enough to read: 1 is one of them."""
    decades = math.log10(high / low)
    subs = (1,) if decades > 3 else (1, 3) if decades > 1.6 else (1, 2, 5) if decades > 0.7 else (1, 1.5, 2, 3, 5, 7) if decades > 0.3 else (1, 1.2, 1.5, 2, 3, 5, 7, 8, 9)
    return [s * 10.0**e for e in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1) for s in subs if low <= s * 10.0**e <= high]


def draw_bars(axes, experiment, scene, bars, first, biased):
    """One scene: bars from 1 to the speed-up. `bars`: (run, Speedup or None); `biased`: summary.biased."""
    axes.set_title(style.wrap(scene, 30))
    known = [s.estimate for _, s in bars if s]
    ends = [e for s in known for e in (s.value, s.low, s.high) if math.isfinite(e)] + [1.0]
    values = [s.value for s in known] + [1.0]
    low, high = max(min(ends), min(values) / WIDEST_INTERVAL), min(max(ends), max(values) * WIDEST_INTERVAL)
    margin = max(high / low, 1.3) ** 0.08
    axes.set_xscale("log")
    axes.set_xlim(low / margin, high * margin)
    for i, (run, s) in enumerate(bars):
        if s is None:
            axes.annotate("no common seed", (1, i), xytext=(3, 0), textcoords="offset points", va="center", fontsize=6.5, color="0.4")
            continue
        e = s.estimate
        faster = e.value >= 1
        axes.barh(i, e.value - 1, left=1, height=0.62, color=style.COLOURS[0] if faster else style.COLOURS[5], hatch="" if faster else "////",
                  edgecolor="white", lw=0, zorder=2)
        if math.isfinite(e.low):
            axes.plot([e.low, e.high], [i, i], color="black", lw=0.9, zorder=3, solid_capstyle="butt")
            axes.plot([e.low, e.high], [i, i], color="black", ls="none", marker="|", ms=5, mew=0.9, zorder=3)
        far = summary.marks(s, (scene, run) in biased or (scene, experiment.base) in biased)
        axes.text(1.02, i, f"{style.short_number(e.value)}{far}", transform=axes.get_yaxis_transform(), va="center", ha="left", fontsize=7)
    axes.axvline(1, color="black", lw=0.8, zorder=4)
    axes.set_ylim(len(bars) - 0.4, -0.6)
    names = [style.wrap(label(run, experiment.base), 24) for run, _ in bars]
    axes.set_yticks(range(len(bars)), names if first else [""] * len(bars))
    axes.tick_params(axis="y", length=0)
    axes.xaxis.set_major_locator(FixedLocator(ratio_ticks(*axes.get_xlim())))
    axes.xaxis.set_major_formatter(FuncFormatter(style.plain_number))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel("speed-up at equal RMSE")
    axes.grid(True, axis="x", color="0.92", lw=0.5)
    axes.set_axisbelow(True)


def draw(experiment):
    biased = summary.biased(summary.lines(experiment))
    with plt.rc_context(style.STYLE):
        count = len(experiment.scenes)
        figure, axes, columns = style.panels(count, 0.55 + 0.24 * len(experiment.others))
        for i, (one, scene) in enumerate(zip(axes, experiment.scenes)):
            draw_bars(one, experiment, scene, [(run, summary.speedup(experiment, scene, run)) for run in experiment.others], i % columns == 0, biased)
    return figure


def make(experiment):
    """Yields the figure of bars."""
    if len(experiment.runs) < 2:
        raise style.NotMade("an ablation needs two runs")
    yield style.Picture(
        "ablation", draw(experiment), f"Speed-up over the run {experiment.base} at equal error",
        f"Bars: time that {experiment.base} needs for an RMSE, over the time that the run needs for the same; right of 1 is faster. Geometric mean over pairs of "
        "equal seeds; whiskers: 95 % confidence interval (Student's, on logarithms). The error is the greatest last error of all seeds of both runs; a star "
        f"marks times extrapolated by more than a factor of {summary.FAR:g} along slope −1/2; a dagger that the mean of the run or of {experiment.base} is off "
        "by more than chance allows, so that the ratio depends on the error at which it is taken. "
        "The run that others are compared with is that of [ablation] in the configuration, else the first.",
        experiment.runs, experiment.scenes)


def sweeps(experiment):
    """{(name, key): [(value as text, run)]} of runs named like lvc[connections=4] that differ in one key only."""
    out = {}
    for run in experiment.runs:
        name, settings = experiments.settings_of(run)
        for key, value in settings.items():
            rest = ", ".join(f"{k}={v}" for k, v in settings.items() if k != key)
            out.setdefault((f"{name}[{rest}]" if rest else name, key), []).append((value, run))
    return {k: in_order(v) for k, v in out.items() if len(v) > 1}


def in_order(entries):
    """Values by size where all are numbers, else as configured."""
    return sorted(entries, key=lambda e: float(e[0])) if all(number_or_none(value) is not None for value, _ in entries) else entries


def number_or_none(text):
    try:
        return float(text)
    except ValueError:
        return None


def draw_sweep(experiment, entries, key):
    """Speed-up over the sweep's first value, which is the least of numbers, a line per scene. Values on a logarithmic axis where all are positive numbers, else by name."""
    numbers = [number_or_none(value) for value, _ in entries]
    numeric = all(n is not None and n > 0 for n in numbers)
    x = numbers if numeric else range(len(entries))
    with plt.rc_context(style.STYLE):
        figure, axes = plt.subplots(figsize=(style.COLUMN, 2.3), layout="constrained")
        for i, scene in enumerate(experiment.scenes):
            first = summary.series(experiment, scene, entries[0][1])
            speedups = [equal_error.speedup(first, summary.series(experiment, scene, run)) for _, run in entries]
            found = [(at, s.estimate) for at, s in zip(x, speedups) if s]
            if not found:
                continue
            at, values = zip(*sorted(found, key=lambda pair: pair[0]))
            axes.plot(at, [e.value for e in values], label=scene, **style.line_style(i))
            axes.fill_between(at, [e.low for e in values], [e.high for e in values], color=style.colour(i), alpha=0.2, lw=0)
        axes.axhline(1, color="0.4", lw=0.8, zorder=1)
        axes.set_yscale("log")
        style.label_log_axis(axes.yaxis, axes.get_ylim())
        if numeric:
            axes.set_xscale("log", base=2)
        style.name_ticks(axes, list(x), [value for value, _ in entries])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel(key)
        axes.set_ylabel("speed-up at equal RMSE")
        axes.grid(True, color="0.92", lw=0.5)
        style.legend_below(figure, *axes.get_legend_handles_labels())
    return figure


def make_sweeps(experiment):
    """Yields a figure per swept key."""
    found = sweeps(experiment)
    if not found:
        raise style.NotMade("no runs of a sweep, named like lvc[connections=4], with two values of a key")
    for (name, key), entries in found.items():
        yield style.Picture(
            style.file_name("sweep", name, key), draw_sweep(experiment, entries, key), f"Speed-up of {name} over its variant {key} = {entries[0][0]}",
            f"At equal RMSE, over {key} = {entries[0][0]}. Lines: geometric mean over pairs of equal seeds; bands: 95 % confidence interval.", [run for _, run in entries], experiment.scenes)
