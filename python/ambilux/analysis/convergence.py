"""Convergence figures: an error against time and against samples per pixel."""

import math

import matplotlib.pyplot as plt
import numpy as np

from ambilux.analysis import remarks, style, summary

TOGETHER = 7  # runs that a panel tells apart; more are split over panels of equal axes, with the others in grey
ROWS = 4  # of such panels in a figure
AXES = {"seconds": "time (s)", "spp": "samples per pixel"}
NAMES = {"rmse": "RMSE", "relmse": "relMSE", "relmse_trimmed": "trimmed relMSE"}


def draw_guide(axes, curves, x, slope):
    """The slope of independent samples, below all data so that it hides none."""
    budgets = np.concatenate([getattr(c, x) for c in curves])
    level = 0.7 * min((c.error * getattr(c, x) ** -slope).min() for c in curves)
    ends = np.array([budgets.min(), budgets.max()])
    axes.plot(ends, level * ends**slope, color="0.5", lw=0.8, dashes=(4, 3), zorder=1, label="slope −1/2" if slope == -0.5 else f"slope −{-slope:g}")


def draw_panel(axes, experiment, scene, x, measure, shown):
    """One scene, or a word in place of it. shown: the runs that are told apart. A run looks the same in all panels and figures."""
    curves = {run: c for run in experiment.runs if (c := summary.curve(experiment, scene, run, measure, x))}
    axes.set_title(style.wrap(scene, 30))
    if not curves:
        axes.text(0.5, 0.5, "no results", ha="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    axes.set_xscale("log")
    axes.set_yscale("log")
    draw_guide(axes, curves.values(), x, summary.SLOPES[measure])
    for run, c in curves.items():
        if run in shown:
            axes.plot(getattr(c, x), c.error, label=run, zorder=3, **style.line_style(experiment.runs.index(run)))
        else:
            axes.plot(getattr(c, x), c.error, color="0.8", lw=0.8, zorder=1.5)
    limits = axes.get_ylim()  # of the lines: a band can be decades wide and would flatten everything
    strength = 0.2 if len(shown) <= 3 else 0.11  # many bands on top of each other
    for run, c in curves.items():
        if run in shown:
            axes.fill_between(getattr(c, x), c.low, c.high, color=style.colour(experiment.runs.index(run)), alpha=strength, lw=0, zorder=2)
    noise = summary.reference_noise(experiment, scene)
    # Shown where it matters: a reference far below the data would only stretch the axis.
    if measure == "rmse" and noise > 0.3 * min(c.error.min() for c in curves.values()):
        axes.axhline(noise, color="0.4", lw=0.8, ls=":", zorder=1, label="reference's noise")
        limits = min(limits[0], noise), limits[1]
    axes.set_ylim(limits[0] / 1.1, limits[1] * 1.1)
    style.label_log_axis(axes.xaxis, axes.get_xlim())
    style.label_log_axis(axes.yaxis, axes.get_ylim())
    axes.set_xlabel(AXES[x])
    axes.grid(True, which="major", color="0.92", lw=0.5)
    axes.set_axisbelow(True)


def label_axis(axes, experiment, measure):
    corrected = all(not math.isnan(r.rmse_corrected) for r in experiment.rows)
    axes.set_ylabel(NAMES[measure] + ("" if corrected else " against the reference"))


def entries_of(axes, runs):
    """Handles and labels of a legend, runs first."""
    found = {label: handle for one in axes for handle, label in zip(*one.get_legend_handles_labels())}
    order = [r for r in runs if r in found] + [e for e in found if e not in runs]
    return [found[e] for e in order], order


def groups_of(runs):
    """The runs in even groups of at most TOGETHER."""
    size = style.balanced(len(runs), TOGETHER)
    return [runs[i:i + size] for i in range(0, len(runs), size)]


def draw(experiment, x="seconds", measure="rmse", scenes=None, width="page"):
    """Figure with one panel per scene, or of more than TOGETHER runs one per scene and group of runs. x: "seconds" or "spp". width: "page" or "column"."""
    scenes, groups = list(scenes or experiment.scenes), groups_of(experiment.runs)
    with plt.rc_context(style.STYLE):
        if len(groups) == 1:
            figure, axes, columns = style.panels(len(scenes), 2.2, style.across(len(scenes), width))
            for i, (one, scene) in enumerate(zip(axes, scenes)):
                draw_panel(one, experiment, scene, x, measure, groups[0])
                if i % columns == 0:
                    label_axis(one, experiment, measure)
            style.legend_below(figure, *entries_of(axes, experiment.runs))
            return figure
        names = {run: style.fit(run, style.PAGE / len(groups) - 0.6, 7) for run in experiment.runs}
        lines = max(sum(names[run].count("\n") + 1 for run in group) for group in groups)
        room = 0.125 * lines + 0.05 * max(map(len, groups)) + 0.35  # inches of the legends, which stand in a row of their own
        figure = plt.figure(figsize=(style.PAGE, 2.1 * len(scenes) + room), layout="constrained")
        rows = figure.add_gridspec(len(scenes) + 1, len(groups), height_ratios=[2.1] * len(scenes) + [room])
        grid = []
        for i, scene in enumerate(scenes):
            grid.append([])
            for k, group in enumerate(groups):
                first = grid[i][0] if k else None
                grid[i].append(figure.add_subplot(rows[i, k], sharex=first, sharey=first))
                draw_panel(grid[i][k], experiment, scene, x, measure, group)
            label_axis(grid[i][0], experiment, measure)
        for k, group in enumerate(groups):
            handles, labels = entries_of([row[k] for row in grid], group)
            below = figure.add_subplot(rows[-1, k])
            below.set_axis_off()
            below.legend(handles, [names.get(label, label) for label in labels], loc="upper center", frameon=False, fontsize=7, borderaxespad=0)
    return figure


def parts_of(experiment):
    """The scenes in lists that a figure has room for."""
    most = ROWS if len(experiment.runs) > TOGETHER else 12
    return [experiment.scenes[i:i + most] for i in range(0, len(experiment.scenes), most)]


def make(experiment):
    """Yields a figure for each error and axis."""
    for measure in summary.recorded(experiment):
        trimmed = f"Without the worst {remarks.trimmed_share(experiment)} of the pixels of each image, which is no estimate of relMSE. " if measure == "relmse_trimmed" else ""
        for x, against in (("seconds", "render time"), ("spp", "samples per pixel")):
            for part, scenes in enumerate(parts_of(experiment)):
                yield style.Picture(
                    f"convergence_{'time' if x == 'seconds' else 'spp'}" + ("" if measure == "rmse" else f"_{measure}") + (f"_{part + 1}" if part else ""),
                    draw(experiment, x, measure, scenes), f"{NAMES[measure]} against {against}",
                    "Lines: arithmetic mean over seeds (RMSE: root of the mean of squares), all pixels; bands: its 95 % interval over seeds, none where few seeds or few pixels do not support "
                    f"one. The noise of the reference is subtracted where it is known. {trimmed}Dashed: the slope of independent samples. Points: checkpoints in "
                    + (("seconds" if x == "seconds" else "samples") if experiment.budget(x) else "the one unit that the experiment has")
                    + (". Grey: the runs of the other panels." if len(experiment.runs) > TOGETHER else "."),
                    experiment.runs, scenes)
