"""Images of the single strategies (s,t) of a bidirectional render, as the pyramid in which Veach 1997, chapter 10, shows them."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from ambilux.analysis import experiment as experiments, images, strategy_variance, style

KINDS = ("weighted", "raw")
ONE_PIXEL = 0.5  # share of a strategy's variance
MERGED = "Merged: both subpaths have their last vertex, so that paths have s + t − 2 segments. "
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB (ITU-R BT.709)


class Strategy(NamedTuple):
    """s vertices from the light and t from the camera; they are connected or, with `merge`, have their last vertex in common."""

    s: int
    t: int
    merge: bool = False

    @property
    def length(self):
        """Segments of its paths."""
        return self.s + self.t - (2 if self.merge else 1)

    @property
    def column(self):
        """Merges stand to the right of the others."""
        return self.merge, self.s

    @property
    def name(self):
        return f"({self.s},{self.t})" + (" merged" if self.merge else "")


@dataclass(frozen=True)
class Techniques:
    """A folder techniques/SCENE/RUN_SEED. entries: {Strategy: {"weighted": path, "raw": path}}; either may be missing."""

    folder: object
    spp: int
    max_depth: int
    entries: dict


def read(folder):
    """Reads techniques.json. Throws InputError."""
    path = folder / "techniques.json"
    data = experiments.read_json(path)
    entries = {}
    for key in ("spp", "max_depth", "entries"):
        if not isinstance(data, dict) or key not in data:
            raise experiments.InputError(f"{path}: lacks '{key}'")
    for i, entry in enumerate(data["entries"]):
        try:
            strategy = Strategy(int(entry["s"]), int(entry["t"]), bool(entry.get("merge", False)))
        except (KeyError, TypeError, ValueError):
            raise experiments.InputError(f"{path}: entries[{i}]: lacks the numbers 's' and 't'") from None
        entries[strategy] = {kind: folder / entry[kind] for kind in KINDS if entry.get(kind)}
        for file in entries[strategy].values():
            if not file.is_file():
                raise experiments.InputError(f"{path}: entries[{i}]: there is no {file.name}; the folder may be half-written")
    if not entries:
        raise experiments.InputError(f"{path}: 'entries' is empty")
    return Techniques(folder, data["spp"], data["max_depth"], entries)


def label(strategy, share=None):
    """`share`: of the light of all pictures; told in per cent."""
    percent = None if share is None else 100 * share
    return strategy.name + ("" if percent is None else " 0" if percent == 0 else " <0.1 %" if percent < 0.1 else f" {percent:.0f} %" if percent >= 9.95 else f" {percent:.1f} %")


def row_factor(row_images):
    """Exposure of a row: puts the 95th percentile of the luminance of all its images' lit pixels at 0.8; 1 for black rows.

    Strategies of one path length estimate the same image as far as they can sample it, so that one factor serves the row. Black pixels do not
    count, because most strategies leave most of their image black.
    """
    stacked = np.concatenate([np.nan_to_num(i).reshape(-1, 3) for i in row_images]) @ LUMINANCE
    lit = stacked[stacked > 0]
    return 0.8 / float(np.percentile(lit, 95)) if len(lit) else 1.0


def weighted_factors(rows):
    """{k: factor} of weighted pictures {k: {column: image}}: the brightest row as row_factor of its sum, each row below it one stop more, those above it the same.

    The brightest row is that with the greatest mean of min(1, exposed luminance), exposed by row_factor of all pictures together: a lamp that is seen directly
    holds much light in few pixels, and an exposure for it would leave the other rows black.
    """
    sums = {k: sum(np.nan_to_num(i) for i in row.values()) for k, row in rows.items()}
    exposed = row_factor([sum(sums.values())])
    brightest = max(sums, key=lambda k: float(np.minimum(exposed * (sums[k] @ LUMINANCE), 1).mean()))
    base, lengths = row_factor([sums[brightest]]), sorted(rows)
    return {k: base * 2.0 ** max(0, lengths.index(k) - lengths.index(brightest)) for k in lengths}


def draw(pictures, kind):
    """`pictures`: {Strategy: image}. Rows: path length k, short ones above; columns: s, merges apart. Returns figure and {k: factor}."""
    lengths = sorted({strategy.length for strategy in pictures})
    columns = sorted({strategy.column for strategy in pictures})
    strategies = {(strategy.length, strategy.column): strategy for strategy in pictures}
    rows = {k: {c: pictures[strategies[k, c]] for c in columns if (k, c) in strategies} for k in lengths}
    if kind == "raw":
        factors = {k: row_factor(row.values()) for k, row in rows.items()}
    else:
        factors = weighted_factors(rows)
    means = {strategy: float(np.nan_to_num(i).mean()) for strategy, i in pictures.items()}
    total = sum(means.values())
    height, width = next(iter(pictures.values())).shape[:2]
    cell = min(1.4, (style.PAGE - 0.55) / len(columns))
    with plt.rc_context(style.STYLE):
        figure, grid = plt.subplots(len(lengths), len(columns), squeeze=False,
                                    figsize=(cell * len(columns) + 0.55, (cell * height / width + 0.14) * len(lengths) + 0.16))
        figure.subplots_adjust(left=0.55 / figure.get_figwidth(), right=1 - 0.02 / figure.get_figwidth(), bottom=0.02, top=1 - 0.16 / figure.get_figheight(),
                               wspace=0.04, hspace=0.14 / (cell * height / width))
        for i, k in enumerate(lengths):
            for j, column in enumerate(columns):
                axes = grid[i][j]
                axes.set_axis_off()
                if column in rows[k]:
                    strategy = strategies[k, column]
                    axes.imshow(images.tone_map(rows[k][column], factors[k]), interpolation="nearest")
                    axes.set_title(label(strategy, means[strategy] / total if kind == "weighted" and total > 0 else None), fontsize=6, pad=1.5)
            grid[i][0].text(-0.06, 0.5, f"k = {k}\n×{style.short_number(factors[k], 2)}", transform=grid[i][0].transAxes, ha="right", va="center", fontsize=7)
    return figure, factors


def make(experiment, scene, run):
    """Yields the weighted and the raw pyramid of the lowest seed of a run."""
    found = experiment.techniques(scene, run)
    if not found:
        raise style.NotMade(f"no techniques/{scene}/{run}_SEED/techniques.json (techniques = 6 in a [[run]])")
    seed, folder = found[0]
    techniques = read(folder)
    for kind in KINDS:
        pictures = {strategy: images.read_exr(files[kind]) for strategy, files in techniques.entries.items() if kind in files}
        if not pictures:
            continue
        figure, factors = draw(pictures, kind)
        how = ("times its MIS weight; all pictures together add up to the light of these path lengths in the image, per cents are shares of it. Each row below the "
               "brightest is exposed one stop more, as in Veach's figure" if kind == "weighted" else "without a weight: each is an estimate of its own of the light of its path length, as far as it can sample it. Each row has an "
               "exposure of its own")
        yield style.Picture(
            style.file_name("techniques", kind, scene, run), figure, f"Strategies of {run} on {scene}, {kind}",
            f"Strategy (s,t), {how} (factors at the left). Rows: path length k = s + t − 1 segments; columns: s vertices from the light. "
            f"{MERGED if any(strategy.merge for strategy in pictures) else ''}Blank: there is no such strategy, or it was not recorded. {techniques.spp} samples per pixel, max_depth {techniques.max_depth}, seed {seed}. After Veach 1997, chapter 10.",
            [run], [scene])


def variances(experiment, scene, run):
    """[(Strategy, Estimate of the variance of one weighted sample, share of the sum, seeds, share of its greatest pixel)] over the seeds that recorded the strategy; [] without two seeds."""
    folders = [read(folder) for _, folder in experiment.techniques(scene, run)]
    if len(folders) < 2:
        return []
    out = []
    for strategy in sorted({s for f in folders for s in f.entries}, key=lambda s: (s.length, s.column)):
        found = [(f.entries[strategy]["weighted"], f.spp) for f in folders if "weighted" in f.entries.get(strategy, {})]
        if len(found) > 1:
            pictures, spp = [images.read_exr(p) for p, _ in found], [spp for _, spp in found]
            out.append((strategy, strategy_variance.strategy_variance(pictures, spp), len(found), strategy_variance.largest_pixel(pictures, spp)))
    total = sum(e.value for _, e, *_ in out)
    return [(strategy, e, e.value / total if total > 0 else math.nan, n, pixel) for strategy, e, n, pixel in out]


def make_variance(experiment, scene, run):
    """Yields the variance of each strategy as shaded cells, rows by k and columns by s, like the pyramid."""
    found = variances(experiment, scene, run)
    if not found:
        raise style.NotMade(f"the variance of strategies needs techniques/{scene}/{run}_SEED of two seeds")
    cells = {(strategy.length, strategy.column): share for strategy, _, share, *_ in found}
    decided = {(strategy.length, strategy.column) for strategy, *_, pixel in found if pixel >= ONE_PIXEL}
    lengths, columns = sorted({k for k, _ in cells}), sorted({column for _, column in cells})
    table = np.array([[cells.get((k, column), math.nan) for column in columns] for k in lengths])
    with plt.rc_context(style.STYLE):
        figure, axes = plt.subplots(figsize=(min(style.PAGE, 0.62 * len(columns) + 1.4), 0.3 * len(lengths) + 0.75), layout="constrained")
        top = max(100 * float(np.nanmax(table)), 1e-9)
        # Logarithmic over four decades: a few strategies often hold nearly all of the variance.
        drawn = axes.imshow(np.clip(100 * table, 1e-4 * top, None), cmap="cividis", aspect="auto", norm=LogNorm(1e-4 * top, top))
        for i, k in enumerate(lengths):
            for j, column in enumerate(columns):
                share = 100 * table[i, j]
                if math.isfinite(share):
                    text = "0" if share == 0 else "<0.01" if share < 0.01 else style.short_number(share, 2)
                    axes.text(j, i, text + ("*" if (k, column) in decided else ""), ha="center", va="center", fontsize=6.5, color="black" if share > 3e-2 * top else "white")
        axes.set_xticks(range(len(columns)), [f"{s}\nmerged" if merge else s for merge, s in columns])
        axes.set_yticks(range(len(lengths)), lengths)
        axes.set_xlabel("s: vertices from the light")
        axes.set_ylabel("k: segments")
        figure.colorbar(drawn, label="% of the sum of variances", extend="min")
    yield style.Picture(
        style.file_name("strategy_variance", scene, run), figure, f"Variance of the strategies of {run} on {scene}",
        f"Unbiased variance over {max(n for *_, n, _ in found)} seeds of each weighted strategy's image, times spp, mean over pixels and channels, as a share of the sum over "
        f"strategies. Strategies share subpaths, so that the sum is not the variance of the image. {'A star: one pixel holds half of it or more, so that a single bright sample decides and other seeds will tell otherwise. ' if decided else ''}Values, from three seeds on with jackknife intervals: strategy_variance.csv.",
        [run], [scene])
