"""Convergence figures: RMSE against time and against samples per pixel."""

import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from analysis import summary

# Okabe and Ito 2008, "Color universal design": told apart with every common kind of colour vision. Yellow is left out: it is too light for lines.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
DASHES = ("-", "--", "-.", ":")
STYLE = {
    "font.size": 8, "axes.titlesize": 9, "axes.labelsize": 8, "legend.fontsize": 8, "xtick.labelsize": 7, "ytick.labelsize": 7,
    "pdf.fonttype": 42, "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6, "svg.hashsalt": "ambilux",
}
PANELS_PER_ROW = 3
AXES = {"seconds": "time (s)", "spp": "samples per pixel"}


def plain_number(x, _=None):
    """Label of a logarithmic tick: digits where they are short, else a power of ten."""
    if 0.001 <= x < 10000:
        return f"{x:g}"
    exponent = math.floor(math.log10(x) + 1e-9)
    factor = round(x / 10**exponent)
    return (rf"${factor}\cdot" if factor != 1 else "$") + rf"10^{{{exponent}}}$"


def label_axis(axis, limits):
    """Decades alone where there are several; numbers between them where the range is short, so that no axis has fewer than two."""
    decades = math.log10(limits[1] / limits[0])
    between = () if decades > 2.7 else (3.0,) if decades > 1.5 else (2.0, 5.0) if decades > 0.8 else (1.5, 2.0, 3.0, 4.0, 5.0, 7.0)
    axis.set_major_locator(LogLocator(10, subs=(1.0, *between)))
    axis.set_major_formatter(FuncFormatter(plain_number))
    axis.set_minor_formatter(NullFormatter())


def draw_guide(axes, curves, x):
    """Slope -1/2, below all data so that it hides none."""
    budgets = np.concatenate([getattr(c, x) for c in curves])
    level = 0.7 * min((c.low * np.sqrt(getattr(c, x))).min() for c in curves)
    ends = np.array([budgets.min(), budgets.max()])
    axes.plot(ends, level / np.sqrt(ends), color="0.5", lw=0.8, dashes=(4, 3), zorder=1, label="slope −1/2")


def draw_panel(axes, experiment, scene, x):
    """One scene. Returns False when there is nothing to draw."""
    curves = [(i, c) for i, run in enumerate(experiment.runs) if (c := summary.curve(experiment, scene, run))]
    axes.set_title(scene)
    if not curves:
        axes.text(0.5, 0.5, "no results", ha="center", transform=axes.transAxes)
        axes.set_axis_off()
        return False
    axes.set_xscale("log")
    axes.set_yscale("log")
    draw_guide(axes, [c for _, c in curves], x)
    for i, c in curves:
        colour, budget = COLOURS[i % len(COLOURS)], getattr(c, x)
        # Past seven runs colours repeat and dashes tell them apart.
        axes.plot(budget, c.error, color=colour, marker=MARKERS[i % len(MARKERS)], ms=3, lw=1.2, ls=DASHES[i // len(COLOURS) % len(DASHES)], label=c.run, zorder=3)
        axes.fill_between(budget, c.low, c.high, color=colour, alpha=0.2, lw=0, zorder=2)
    noise = summary.reference_noise(experiment, scene)
    # Shown where it matters: a reference far below the data would only stretch the axis.
    if noise > 0.3 * min(c.error.min() for _, c in curves):
        axes.axhline(noise, color="0.4", lw=0.8, ls=":", zorder=1, label="noise of the reference")
    label_axis(axes.xaxis, axes.get_xlim())
    label_axis(axes.yaxis, axes.get_ylim())
    axes.set_xlabel(AXES[x])
    axes.grid(True, which="major", color="0.92", lw=0.5)
    axes.set_axisbelow(True)
    return True


def convergence(experiment, x):
    """Figure with one panel per scene; x is "seconds" or "spp". Lines: geometric mean over seeds; bands: least to greatest seed."""
    count = len(experiment.scenes)
    columns = 2 if count == 4 else min(PANELS_PER_ROW, count)
    rows = math.ceil(count / columns)
    with plt.rc_context(STYLE):
        width = 2.4 * columns + 0.3 if columns > 1 else 3.5
        figure, grid = plt.subplots(rows, columns, figsize=(width, 2.25 * rows + 0.55), squeeze=False, layout="constrained")
        entries = {}
        for i, axes in enumerate(grid.flat):
            if i >= count:
                axes.set_axis_off()
                continue
            draw_panel(axes, experiment, experiment.scenes[i], x)
            if i % columns == 0:
                corrected = all(not math.isnan(r.rmse_corrected) for r in experiment.rows)
                axes.set_ylabel("RMSE" if corrected else "RMSE against the reference")
            for handle, label in zip(*axes.get_legend_handles_labels()):
                entries.setdefault(label, handle)
        order = [r for r in experiment.runs if r in entries] + [e for e in entries if e not in experiment.runs]
        figure.legend([entries[e] for e in order], order, loc="outside lower center", ncols=min(len(order), 2 * columns if columns > 1 else 2), frameon=False)
    return figure


def save(figure, path_without_suffix):
    """Writes PDF and PNG (200 dpi) and closes the figure. The same data give the same bytes: no dates in the files."""
    with plt.rc_context(STYLE):
        figure.savefig(f"{path_without_suffix}.pdf", metadata={"CreationDate": None})
        figure.savefig(f"{path_without_suffix}.png", dpi=200)
    plt.close(figure)
