"""One page for a talk: what was compared, error against time, and the ratio of efficiencies of every run in every scene."""

import math

import matplotlib.pyplot as plt
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from ambilux.analysis import ablation, convergence, efficiency, style, summary, tables, verdicts

SIZE = (10.0, 5.63)  # inches: 16 to 9
ROWS_HEIGHT = 4.2  # inches of all rows of ratios
MOST_SCENES = 2  # with a panel of their own
LARGER = {"font.size": 10, "axes.titlesize": 11, "axes.labelsize": 10, "legend.fontsize": 9, "xtick.labelsize": 9, "ytick.labelsize": 9}


def draw_ratios(axes, experiment, lines):
    """Points with intervals, a row per run and a colour per scene; hollow where the data support no interval, with a dagger where a mean is off."""
    biased = verdicts.biased(lines)
    shown = [r for r in experiment.runs if r != experiment.base]
    height = 0.7 / max(1, len(experiment.scenes))
    for i, scene in enumerate(experiment.scenes):
        for line in lines:
            r = line.ratio
            if line.scene != scene or line.run not in shown or r is None or not math.isfinite(r.value):
                continue
            y = shown.index(line.run) + (i - (len(experiment.scenes) - 1) / 2) * height
            axes.plot(r.value, y, ls="none", marker=style.marker(i), ms=5, mec=style.colour(i), mfc=style.colour(i) if r.trusted else "none",
                      label=scene)
            if r.trusted:
                axes.plot([r.low, r.high], [y, y], color=style.colour(i), lw=1.2)
            if biased & {(scene, line.run), (scene, experiment.base)}:
                axes.annotate("†", (max(r.value, r.high if r.trusted else 0), y), xytext=(5, 0), textcoords="offset points", va="center", fontsize=8, color=style.colour(i))
    axes.axvline(1, color="0.3", lw=0.8, zorder=0)
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xlim(low / 1.1, high * 1.1)
    axes.xaxis.set_major_locator(FixedLocator(ablation.ratio_ticks(*axes.get_xlim())))
    axes.xaxis.set_major_formatter(FuncFormatter(style.plain_number))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())
    names = [style.wrap(run, 30) for run in shown]
    row = 72 * ROWS_HEIGHT / max(1, len(shown))  # points
    axes.set_yticks(range(len(shown)), names, fontsize=min(9, row / (1.3 * max((n.count("\n") + 1 for n in names), default=1))))
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.grid(True, axis="x", color="0.92", lw=0.6)
    axes.set_title(f"1 / ({efficiency.NAMES[experiment.metric]} · time) over that of {experiment.base}", loc="right")


def draw(experiment):
    """The figure. More than TOGETHER runs: the panels tell the best ones of the first scene apart and show the others in grey."""
    lines = summary.lines(experiment)
    measure = "relmse" if experiment.metric == "relmse" else "rmse"
    scenes = experiment.scenes[:MOST_SCENES]
    ranked = sorted((line for line in lines if line.scene == scenes[0] and math.isfinite(line.efficiency.value)), key=lambda line: -line.efficiency.value)
    best = {line.run for line in ranked[:convergence.TOGETHER]}
    told = experiment.runs if len(experiment.runs) <= convergence.TOGETHER else [run for run in experiment.runs if run in best]
    with plt.rc_context(style.STYLE | LARGER):
        figure = plt.figure(figsize=SIZE, layout="constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(1, 1.15) if len(scenes) == 1 else (1.25, 1))
        panels = left.subplots(len(scenes), 1, squeeze=False, sharex=True)[:, 0]
        for axes, scene in zip(panels, scenes):
            convergence.draw_panel(axes, experiment, scene, "seconds", measure, told)
            axes.set_title("")
            axes.set_title(style.wrap(scene, 40), loc="left")
            axes.set_ylabel(convergence.NAMES[measure])
            if axes is not panels[-1]:
                axes.set_xlabel("")
        handles, labels = convergence.entries_of(panels, told)
        left.legend(handles, [style.wrap(label, 26) for label in labels], loc="outside lower center", ncols=2, frameon=False)
        axes = right.subplots()
        draw_ratios(axes, experiment, lines)
        handles, labels = convergence.entries_of([axes], experiment.scenes)
        if len(experiment.scenes) > 1 and labels:
            right.legend(handles, [style.wrap(label, 26) for label in labels], loc="outside lower center", ncols=2, frameon=False)
        seeds = sorted({r.seed for r in experiment.rows})
        figure.suptitle(f"{experiment.name}: {len(experiment.scenes)} scene{'s' if len(experiment.scenes) > 1 else ''}, {len(experiment.runs)} methods, {len(seeds)} seeds", fontsize=12, x=0.01, ha="left")
    return figure


def make(experiment):
    """Yields the figure."""
    if len(experiment.runs) < 2:
        raise style.NotMade("a comparison needs two runs")
    lines = summary.lines(experiment)
    more = f" Of {len(experiment.scenes)} scenes the first {MOST_SCENES} have panels of their own." if len(experiment.scenes) > MOST_SCENES else ""
    grey = f" Grey: runs that are not among the {convergence.TOGETHER} most efficient ones of the first scene." if len(experiment.runs) > convergence.TOGETHER else ""
    yield style.Picture(
        "overview", draw(experiment), f"Overview of {experiment.name}",
        f"Left: error against time, arithmetic mean over seeds, all pixels; bands: its 95 % interval over seeds.{grey} Right: ratio of efficiencies over {experiment.base} at {tables.EQUAL[summary.equal(experiment)]}, "
        f"with 95 % intervals over {tables.units(lines)}; hollow: the data support no interval; a dagger: the mean of the run or of {experiment.base} is off by more than chance allows.{more}", experiment.runs, experiment.scenes)
