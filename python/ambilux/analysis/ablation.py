"""Ablation: one switch at a time against a default run, as bars of ratios of efficiencies with intervals; sweeps over the values of a setting."""

import math

import matplotlib.pyplot as plt
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from ambilux.analysis import efficiency, experiment as experiments, same_estimator, style, summary, tables, verdicts

WIDEST_INTERVAL = 30.0  # bars of two seeds can have intervals over decades; the axis shows this much beyond the values
RATIO = "ratio of efficiencies"


def label(run, base):
    """A run of a sweep over the base run by what differs."""
    name, settings = experiments.settings_of(run)
    short = ", ".join(f"{k} = {v}" for k, v in settings.items())
    return short if settings and name == experiments.settings_of(base)[0] else run


def label_lines(runs, base):
    return [style.wrap(label(run, base), 26) for run in runs]


def ratio_ticks(low, high):
    """Ticks of a logarithmic axis of ratios, few enough to read: 1 is one of them."""
    decades = math.log10(high / low)
    subs = (1,) if decades > 3 else (1, 3) if decades > 1.6 else (1, 2, 5) if decades > 0.7 else (1, 1.5, 2, 3, 5, 7) if decades > 0.4 else (1, 1.2, 1.5, 2, 3, 5, 7, 8, 9)
    return [s * 10.0**e for e in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1) for s in subs if low <= s * 10.0**e <= high]


def draw_bars(axes, experiment, scene, bars, first, biased):
    """One scene: bars from 1 to the ratio of efficiencies. `bars`: (run, Judged or None); `biased`: verdicts.biased."""
    axes.set_title(style.wrap(scene, 30))
    known = [r for _, r in bars if r and math.isfinite(r.value)]
    ends = [e for r in known for e in (r.value, r.low, r.high) if math.isfinite(e)] + [1.0]
    values = [r.value for r in known] + [1.0]
    low, high = max(min(ends), min(values) / WIDEST_INTERVAL), min(max(ends), max(values) * WIDEST_INTERVAL)
    margin = max(high / low, 1.3) ** 0.08
    axes.set_xscale("log")
    axes.set_xlim(low / margin, high * margin)
    for i, (run, r) in enumerate(bars):
        if r is None or not math.isfinite(r.value):
            axes.annotate("no results" if r is None else r.doubt, (1, i), xytext=(3, 0), textcoords="offset points", va="center", fontsize=6.5, color="0.4")
            continue
        better = r.value >= 1
        if r.trusted:
            axes.barh(i, r.value - 1, left=1, height=0.62, color=style.COLOURS[0] if better else style.COLOURS[5], hatch="" if better else "////",
                      edgecolor="white", lw=0, zorder=2)
            axes.plot([r.low, r.high], [i, i], color="black", lw=0.9, zorder=3, solid_capstyle="butt", marker="|", ms=5, mew=0.9)
        else:  # an outline: the value is there, how sure it is cannot be said
            axes.barh(i, r.value - 1, left=1, height=0.62, color="none", edgecolor="0.5", ls=(0, (2, 2)), lw=0.7, zorder=2)
        dagger = "†" if (scene, run) in biased or (scene, experiment.base) in biased else ""
        axes.text(1.02, i, (style.short_number(r.value) if r.trusted else "?") + (" =" if r.over == same_estimator.OVER else "") + dagger, transform=axes.get_yaxis_transform(), va="center", ha="left", fontsize=7)
    axes.axvline(1, color="black", lw=0.8, zorder=4)
    axes.set_ylim(len(bars) - 0.4, -0.6)
    names = label_lines([run for run, _ in bars], experiment.base)
    axes.set_yticks(range(len(bars)), names if first else [""] * len(bars), fontsize=style.row_height(names, 0)[1])
    axes.tick_params(axis="y", length=0)
    axes.xaxis.set_major_locator(FixedLocator(ratio_ticks(*axes.get_xlim())))
    axes.xaxis.set_major_formatter(FuncFormatter(style.plain_number))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(RATIO)
    axes.grid(True, axis="x", color="0.92", lw=0.5)
    axes.set_axisbelow(True)


def draw(experiment, width="page"):
    """Figure of bars, a panel per scene. width: "page" or "column"."""
    found = summary.lines(experiment)
    biased, ratios = verdicts.biased(found), {(line.scene, line.run): line.ratio for line in found}
    with plt.rc_context(style.STYLE):
        height, _ = style.row_height(label_lines(experiment.others, experiment.base), 0.24)
        figure, axes, columns = style.panels(len(experiment.scenes), 0.55 + height * len(experiment.others), style.across(len(experiment.scenes), width))
        for i, (one, scene) in enumerate(zip(axes, experiment.scenes)):
            draw_bars(one, experiment, scene, [(run, ratios.get((scene, run))) for run in experiment.others], i % columns == 0, biased)
    return figure


def make(experiment):
    """Yields the figure of bars."""
    if len(experiment.runs) < 2:
        raise style.NotMade("an ablation needs two runs")
    lines = summary.lines(experiment)
    yield style.Picture(
        "ablation", draw(experiment), f"Efficiency over that of the run {experiment.base}",
        f"Bars: 1 / ({efficiency.NAMES[experiment.metric]} · time) of a run over that of {experiment.base}, at {tables.EQUAL[summary.equal(experiment)]}, all pixels, arithmetic means; right of 1 is better. "
        f"Whiskers: 95 % interval over {tables.units(lines)}. {tables.same_sentence(lines, experiment.base)}Dashed outlines with a question mark: the data do not support an interval, the table says why. "
        f"A dagger: the mean of the run or of {experiment.base} is off by more than chance allows. "
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
    return {(name, key): in_order(v) for (name, key), v in out.items() if len(v) + (name in experiment.runs) > 1}


def in_order(entries):
    """Values by size where all are numbers, else as configured."""
    return sorted(entries, key=lambda e: float(e[0])) if all(number_or_none(value) is not None for value, _ in entries) else entries


def number_or_none(text):
    try:
        return float(text)
    except ValueError:
        return None


def with_default(experiment, name, key, entries):
    """The entries and, if the run that the sweep starts from is there, that run under the value that it recorded: [(value, run)], and its place or None."""
    if name not in experiment.runs:
        return entries, None
    recorded = next((str(found[key]).lower() for scene in experiment.scenes for found in experiment.stats(scene, name) if key in found), "default")
    every = in_order([(recorded, name), *entries])
    return every, [run for _, run in every].index(name)


def draw_sweep(experiment, entries, key, first=0, width="column"):
    """Ratios of efficiencies over that of the entry `first`: lines over positive numbers on a logarithmic axis, points beside each other over names."""
    numbers = [number_or_none(value) for value, _ in entries]
    numeric = all(n is not None and n > 0 for n in numbers)
    scenes = [scene for scene in experiment.scenes if experiment.last_common_checkpoint(scene) is not None]
    with plt.rc_context(style.STYLE):
        figure, axes = plt.subplots(figsize=(style.COLUMN if width == "column" else style.PAGE, 2.3), layout="constrained")
        for i, scene in enumerate(scenes):
            x = numbers if numeric else [n + 0.7 * ((i + 0.5) / len(scenes) - 0.5) for n in range(len(entries))]
            ratios = [summary.ratio_over(experiment, scene, run, entries[first][1]) for _, run in entries]
            found = [(at, r, n == first) for n, (at, r) in enumerate(zip(x, ratios)) if r and math.isfinite(r.value)]
            if not found:
                continue
            looks = style.line_style(i) | ({} if numeric else {"ls": "none"})
            axes.plot([at for at, *_ in found], [r.value for _, r, _ in found], label=scene, **looks)
            for at, r, is_first in found:
                if is_first:
                    continue  # over itself: 1
                if r.trusted:
                    axes.plot([at, at], [r.low, r.high], color=style.colour(i), lw=1, solid_capstyle="butt")
                else:  # hollow, over the full one
                    axes.plot(at, r.value, marker=style.marker(i), ms=4, mfc="white", mec=style.colour(i), mew=0.8, zorder=4)
        axes.axhline(1, color="0.4", lw=0.8, zorder=1)
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(FixedLocator(ratio_ticks(*axes.get_ylim())))
        axes.yaxis.set_major_formatter(FuncFormatter(style.plain_number))
        axes.yaxis.set_minor_locator(NullLocator())
        if numeric:
            axes.set_xscale("log", base=2)
        names = [value + ("\n(default)" if run == experiment.base and experiments.settings_of(run)[1] == {} else "") for value, run in entries]
        style.name_ticks(axes, numbers if numeric else list(range(len(entries))), names)
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_xlabel(key)
        axes.set_ylabel(RATIO)
        axes.grid(True, color="0.92", lw=0.5)
        style.legend_below(figure, *axes.get_legend_handles_labels())
    return figure


def make_sweeps(experiment):
    """Yields a figure per swept key."""
    found = sweeps(experiment)
    if not found:
        raise style.NotMade("no runs of a sweep, named like lvc[connections=4], with two values of a key")
    for (name, key), entries in found.items():
        every, default = with_default(experiment, name, key, entries)
        first = default or 0
        yield style.Picture(
            style.file_name("sweep", name, key), draw_sweep(experiment, every, key, first), f"Efficiency of {name} over its variant {key} = {every[first][0]}",
            f"1 / ({efficiency.NAMES[experiment.metric]} · time) over that of {key} = {every[first][0]}. Bars: 95 % interval over batches of passes, over seeds where those are not to be trusted, of runs that make the same images over pairs of seeds; hollow: the data do "
            "not support one.", [run for _, run in every], experiment.scenes)
