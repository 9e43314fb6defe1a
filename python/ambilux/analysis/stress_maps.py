"""Heat maps of a stress sweep: families as blocks of rows, one for each value of their parameter; methods as columns, backends side by side."""

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import colors
from matplotlib.patches import Patch

from ambilux.analysis import style
from ambilux.analysis.stress_sweep import VERDICTS, backend_differences, measured

# Letters tell states apart without colour.
STATES = {"failed": ("B", style.COLOURS[1], "biased, no known limit"), "invalid": ("I", style.COLOURS[3], "invalid or lost values, counted"),
          "refused": ("R", style.COLOURS[0], "refused with a message"), "limit": ("L", style.COLOURS[5], "off as docs/numerics.md says"),
          "noisy": ("N", "#BBBBBB", "too few events to judge"), "ok": ("", "#D9EFE3", "right"), "left out": ("", "#FFFFFF", "not rendered: finds no such light")}
ROWS_A_PAGE = 120
ROW = 0.082  # inches
LIMIT_Z = 8.0


def pages(sweep):
    """Lists of (family, cells) of at most ROWS_A_PAGE rows, with a row between families."""
    lists, used = [[]], 0
    for family, cells in sweep.families.items():
        if used and used + len(cells) + 1 > ROWS_A_PAGE:
            lists.append([])
            used = 0
        lists[-1].append((family, cells))
        used += len(cells) + 1
    return lists


def lay_out(columns):
    """Places of columns along x with a gap between backends."""
    places, x = {}, 0.0
    for i, column in enumerate(columns):
        if i and column[0] != columns[i - 1][0]:
            x += 0.6
        places[column] = x
        x += 1
    return places, x


def draw(sweep, page, columns, colour_of, letter_of):
    """One page. colour_of, letter_of: functions of a row; no colour leaves the place empty."""
    places, width = lay_out(columns)
    count = sum(len(cells) + 1 for _, cells in page)
    figure, axes = plt.subplots(figsize=(style.PAGE, ROW * count + 1.5), layout="constrained")
    labels, at, y = [], [], 0
    for family, cells in page:
        axes.text(-0.17, y + len(cells) / 2 - 0.5, family, transform=axes.get_yaxis_transform(), ha="right", va="center", fontsize=6)
        for cell in cells:
            labels.append(cell[len(family) + 1:])
            at.append(y)
            for column in columns:
                row = sweep.rows.get((*column, cell))
                if row is None or (colour := colour_of(row)) is None:
                    continue
                x = places[column]
                axes.add_patch(plt.Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour, edgecolor="0.85", lw=0.2))
                if letter := letter_of(row):
                    axes.text(x, y + 0.05, letter, ha="center", va="center", fontsize=4)
            y += 1
        y += 1
    axes.set_xlim(-0.7, width - 0.3)
    axes.set_ylim(y - 0.5, -1)
    axes.set_yticks(at, labels, fontsize=4.5)
    axes.set_xticks([places[c] for c in columns], [m for _, m in columns], rotation=90, fontsize=6)
    axes.xaxis.tick_top()
    axes.tick_params(length=0, pad=1)
    axes.spines[:].set_visible(False)
    for backend in dict.fromkeys(b for b, _ in columns):
        xs = [places[c] for c in columns if c[0] == backend]
        axes.text((xs[0] + xs[-1]) / 2, y, backend, ha="center", va="top", fontsize=7)
    return figure, axes


def state_maps(sweep):
    for i, page in enumerate(pages(sweep)):
        figure, axes = draw(sweep, page, sweep.columns, lambda r: STATES[r["verdict"]][1], lambda r: STATES[r["verdict"]][0])
        found = [v for v in VERDICTS if sweep.count(v)]
        handles = [Patch(facecolor=STATES[v][1], edgecolor="0.6", lw=0.4) for v in found]
        style.legend_below(figure, handles, [f"{STATES[v][0]} {STATES[v][2]}".strip() for v in found])
        yield style.Picture(f"stress_states_{i + 1}", figure, f"States, part {i + 1}", "One field for each cell and method.", [], [])


def number_maps(sweep, columns, name, title, caption, value, norm, label):
    """value: of a row, None to leave it empty."""
    table = plt.get_cmap(style.SIGNED_COLOURS)
    for i, page in enumerate(pages(sweep)):
        def colour(row):
            v = value(row)
            return None if v is None or math.isnan(v) else table(norm(np.clip(v, norm.vmin, norm.vmax)))
        figure, axes = draw(sweep, page, columns, colour, lambda row: "")
        bar = figure.colorbar(plt.cm.ScalarMappable(norm, table), ax=axes, location="bottom", fraction=0.02, aspect=60, pad=0.01)
        bar.set_label(label)
        yield style.Picture(f"{name}_{i + 1}", figure, f"{title}, part {i + 1}", caption, [], [])


def z_of(row):
    if not measured(row):
        return None
    return row["z"] if abs(row["z"]) >= abs(row["box_z"]) else row["box_z"]


def variance_of(row):
    return math.log10(row["variance_ratio"]) if row["variance_ratio"] > 0 else None


def make_all(sweep):
    with plt.rc_context(style.STYLE):
        return make(sweep)


def make(sweep):
    pictures = list(state_maps(sweep))
    signed = colors.TwoSlopeNorm(0, -LIMIT_Z, LIMIT_Z)
    pictures += number_maps(sweep, sweep.columns, "stress_z", "Significance of the bias",
                            "Normal equivalent of the difference from the answer, of the mean or of the box of pixels that is furthest off; purple is too bright.",
                            z_of, signed, "z")
    pictures += number_maps(sweep, sweep.columns, "stress_variance", "Variance against the benign cell",
                            "Relative variance of a sample over that of the family's benign cell by the same method, as a power of ten.",
                            variance_of, colors.TwoSlopeNorm(0, -4, 4), "log10 of the ratio of relative variances")
    differences = {(m, c): z for m, c, z, _, _ in backend_differences(sweep)}
    if differences:
        pictures += number_maps(sweep, [c for c in sweep.columns if c[0] == "cpu"], "stress_backends", "CPU against CUDA",
                                "Difference of the means of both backends over its error.", lambda r: differences.get((r["method"], r["cell"])), signed, "z")
    return pictures
