"""Convergence figures: an error against time and against samples per pixel."""

import math

import matplotlib.pyplot as plt
import numpy as np

from analysis import remarks, style, summary

AXES = {"seconds": "time (s)", "spp": "samples per pixel"}
NAMES = {"rmse": "RMSE", "relmse": "relMSE", "relmse_trimmed": "trimmed relMSE"}


def draw_guide(axes, curves, x, slope):
    """The slope of independent samples, below all data so that it hides none."""
    budgets = np.concatenate([getattr(c, x) for c in curves])
    level = 0.7 * min((c.error * getattr(c, x) ** -slope).min() for c in curves)
    ends = np.array([budgets.min(), budgets.max()])
    axes.plot(ends, level * ends**slope, color="0.5", lw=0.8, dashes=(4, 3), zorder=1, label="slope −1/2" if slope == -0.5 else f"slope −{-slope:g}")


def draw_panel(axes, experiment, scene, x, measure):
    """One scene, or a word in place of it."""
    curves = [(i, c) for i, run in enumerate(experiment.runs) if (c := summary.curve(experiment, scene, run, measure, x))]
    axes.set_title(style.wrap(scene, 30))
    if not curves:
        axes.text(0.5, 0.5, "no results", ha="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    axes.set_xscale("log")
    axes.set_yscale("log")
    draw_guide(axes, [c for _, c in curves], x, summary.SLOPES[measure])
    for i, c in curves:
        axes.plot(getattr(c, x), c.error, label=c.run, zorder=3, **style.line_style(i))
    limits = axes.get_ylim()  # of the lines: a band of two seeds can be decades wide and would flatten everything
    strength = 0.2 if len(curves) <= 3 else 0.11  # many bands on top of each other
    for i, c in curves:
        axes.fill_between(getattr(c, x), c.low, c.high, color=style.colour(i), alpha=strength, lw=0, zorder=2)
    noise = summary.reference_noise(experiment, scene)
    # Shown where it matters: a reference far below the data would only stretch the axis.
    if measure == "rmse" and noise > 0.3 * min(c.error.min() for _, c in curves):
        axes.axhline(noise, color="0.4", lw=0.8, ls=":", zorder=1, label="reference's noise")
        limits = min(limits[0], noise), limits[1]
    axes.set_ylim(limits[0] / 1.1, limits[1] * 1.1)
    style.label_log_axis(axes.xaxis, axes.get_xlim())
    style.label_log_axis(axes.yaxis, axes.get_ylim())
    axes.set_xlabel(AXES[x])
    axes.grid(True, which="major", color="0.92", lw=0.5)
    axes.set_axisbelow(True)


def draw(experiment, x, measure):
    """Figure with one panel per scene; x is "seconds" or "spp"."""
    with plt.rc_context(style.STYLE):
        figure, axes, columns = style.panels(len(experiment.scenes), 2.2)
        corrected = all(not math.isnan(r.rmse_corrected) for r in experiment.rows)
        entries = {}
        for i, (one, scene) in enumerate(zip(axes, experiment.scenes)):
            draw_panel(one, experiment, scene, x, measure)
            if i % columns == 0:
                one.set_ylabel(NAMES[measure] + ("" if corrected else " against the reference"))
            for handle, label in zip(*one.get_legend_handles_labels()):
                entries.setdefault(label, handle)
        order = [r for r in experiment.runs if r in entries] + [e for e in entries if e not in experiment.runs]
        style.legend_below(figure, [entries[e] for e in order], order)
    return figure


def make(experiment):
    """Yields a figure for each error and axis."""
    for measure in summary.recorded(experiment):
        trimmed = f"Without the worst {remarks.trimmed_share(experiment)} of the pixels of each image, which is no estimate of relMSE. " if measure == "relmse_trimmed" else ""
        for x, against in (("seconds", "render time"), ("spp", "samples per pixel")):
            yield style.Picture(
                f"convergence_{'time' if x == 'seconds' else 'spp'}" + ("" if measure == "rmse" else f"_{measure}"), draw(experiment, x, measure),
                f"{NAMES[measure]} against {against}",
                "Lines: arithmetic mean over seeds (RMSE: root of the mean of squares), all pixels; bands: its 95 % interval over seeds, none where few seeds or few pixels do not support one. The noise of the "
                f"reference is subtracted where it is known. {trimmed}Dashed: the slope of independent samples. Points: checkpoints in "
                + (("seconds" if x == "seconds" else "samples") if experiment.budget(x) else "the one unit that the experiment has") + ".",
                experiment.runs, experiment.scenes)
