"""Images of the single strategies (s,t) of a bidirectional render, as the pyramid in which Veach 1997, chapter 10, shows them."""

import math
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from analysis import experiment as experiments, images, strategy_variance, style

KINDS = ("weighted", "raw")
ONE_PIXEL = 0.5  # share of a strategy's variance
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB (ITU-R BT.709)


@dataclass(frozen=True)
class Techniques:
    """A folder techniques/SCENE/RUN_SEED. entries: {(s, t): {"weighted": path, "raw": path}}; either may be missing."""

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
            s, t = int(entry["s"]), int(entry["t"])
        except (KeyError, TypeError, ValueError):
            raise experiments.InputError(f"{path}: entries[{i}]: lacks the numbers 's' and 't'") from None
        entries[s, t] = {kind: folder / entry[kind] for kind in KINDS if entry.get(kind)}
        for file in entries[s, t].values():
            if not file.is_file():
                raise experiments.InputError(f"{path}: entries[{i}]: there is no {file.name}; the folder may be half-written")
    if not entries:
        raise experiments.InputError(f"{path}: 'entries' is empty")
    return Techniques(folder, data["spp"], data["max_depth"], entries)


def label(s, t, share=None):
    """`share`: of the light of all pictures; told in per cent."""
    percent = None if share is None else 100 * share
    return f"({s},{t})" + ("" if percent is None else " 0" if percent == 0 else " <0.1 %" if percent < 0.1 else f" {percent:.0f} %" if percent >= 9.95 else f" {percent:.1f} %")


def row_factor(row_images):
    """Exposure of a row: puts the 95th percentile of the luminance of all its images' lit pixels at 0.8; 1 for black rows.

    Strategies of one path length estimate the same image as far as they can sample it, so that one factor serves the row. Black pixels do not
    count, because most strategies leave most of their image black.
    """
    stacked = np.concatenate([np.nan_to_num(i).reshape(-1, 3) for i in row_images]) @ LUMINANCE
    lit = stacked[stacked > 0]
    return 0.8 / float(np.percentile(lit, 95)) if len(lit) else 1.0


def weighted_factors(rows):
    """{k: factor} of weighted pictures {k: {s: image}}: the brightest row as row_factor of its sum, each row below it one stop more, those above it the same.

    The brightest row is that with the greatest mean of min(1, exposed luminance), exposed by row_factor of all pictures together: a lamp that is seen directly
    holds much light in few pixels, and an exposure for it would leave the other rows black.
    """
    sums = {k: sum(np.nan_to_num(i) for i in row.values()) for k, row in rows.items()}
    exposed = row_factor([sum(sums.values())])
    brightest = max(sums, key=lambda k: float(np.minimum(exposed * (sums[k] @ LUMINANCE), 1).mean()))
    base, lengths = row_factor([sums[brightest]]), sorted(rows)
    return {k: base * 2.0 ** max(0, lengths.index(k) - lengths.index(brightest)) for k in lengths}


def draw(pictures, kind):
    """`pictures`: {(s, t): image}. Rows: path length k = s + t - 1, short ones above; columns: s. Returns figure and {k: factor}."""
    lengths = sorted({s + t - 1 for s, t in pictures})
    columns = sorted({s for s, _ in pictures})
    rows = {k: {s: pictures[s, k + 1 - s] for s in columns if (s, k + 1 - s) in pictures} for k in lengths}
    if kind == "raw":
        factors = {k: row_factor(row.values()) for k, row in rows.items()}
    else:
        factors = weighted_factors(rows)
    means = {st: float(np.nan_to_num(i).mean()) for st, i in pictures.items()}
    total = sum(means.values())
    height, width = next(iter(pictures.values())).shape[:2]
    cell = min(1.4, (style.PAGE - 0.55) / len(columns))
    with plt.rc_context(style.STYLE):
        figure, grid = plt.subplots(len(lengths), len(columns), squeeze=False,
                                    figsize=(cell * len(columns) + 0.55, (cell * height / width + 0.14) * len(lengths) + 0.16))
        figure.subplots_adjust(left=0.55 / figure.get_figwidth(), right=1 - 0.02 / figure.get_figwidth(), bottom=0.02, top=1 - 0.16 / figure.get_figheight(),
                               wspace=0.04, hspace=0.14 / (cell * height / width))
        for i, k in enumerate(lengths):
            for j, s in enumerate(columns):
                axes = grid[i][j]
                axes.set_axis_off()
                if s in rows[k]:
                    axes.imshow(images.tone_map(rows[k][s], factors[k]), interpolation="nearest")
                    axes.set_title(label(s, k + 1 - s, means[s, k + 1 - s] / total if kind == "weighted" and total > 0 else None), fontsize=6, pad=1.5)
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
        pictures = {st: images.read_exr(files[kind]) for st, files in techniques.entries.items() if kind in files}
        if not pictures:
            continue
        figure, factors = draw(pictures, kind)
        how = ("times its MIS weight; all pictures together add up to the light of these path lengths in the image, per cents are shares of it. Each row below the "
               "brightest is exposed one stop more, as in Veach's figure" if kind == "weighted" else "without a weight: each is an estimate of its own of the light of its path length, as far as it can sample it. Each row has an "
               "exposure of its own")
        yield style.Picture(
            style.file_name("techniques", kind, scene, run), figure, f"Strategies of {run} on {scene}, {kind}",
            f"Strategy (s,t), {how} (factors at the left). Rows: path length k = s + t − 1 segments; columns: s vertices from the light. Blank: there is no such strategy, "
            f"or it was not recorded. {techniques.spp} samples per pixel, max_depth {techniques.max_depth}, seed {seed}. After Veach 1997, chapter 10.",
            [run], [scene])


def variances(experiment, scene, run):
    """[(s, t, Estimate of the variance of one weighted sample, share of the sum, seeds, share of its greatest pixel)] over the seeds that recorded the strategy; [] without two seeds."""
    folders = [read(folder) for _, folder in experiment.techniques(scene, run)]
    if len(folders) < 2:
        return []
    out = []
    for st in sorted({st for f in folders for st in f.entries}, key=lambda st: (sum(st), st[0])):
        found = [(f.entries[st]["weighted"], f.spp) for f in folders if "weighted" in f.entries.get(st, {})]
        if len(found) > 1:
            pictures, spp = [images.read_exr(p) for p, _ in found], [spp for _, spp in found]
            out.append((*st, strategy_variance.strategy_variance(pictures, spp), len(found), strategy_variance.largest_pixel(pictures, spp)))
    total = sum(e.value for _, _, e, *_ in out)
    return [(s, t, e, e.value / total if total > 0 else math.nan, n, pixel) for s, t, e, n, pixel in out]


def make_variance(experiment, scene, run):
    """Yields the variance of each strategy as shaded cells, rows by k and columns by s, like the pyramid."""
    found = variances(experiment, scene, run)
    if not found:
        raise style.NotMade(f"the variance of strategies needs techniques/{scene}/{run}_SEED of two seeds")
    cells = {(s, t): share for s, t, _, share, *_ in found}
    decided = {(s, t) for s, t, *_, pixel in found if pixel >= ONE_PIXEL}
    lengths, columns = sorted({s + t - 1 for s, t in cells}), sorted({s for s, _ in cells})
    table = np.array([[cells.get((s, k + 1 - s), math.nan) for s in columns] for k in lengths])
    with plt.rc_context(style.STYLE):
        figure, axes = plt.subplots(figsize=(min(style.PAGE, 0.62 * len(columns) + 1.4), 0.3 * len(lengths) + 0.75), layout="constrained")
        top = max(100 * float(np.nanmax(table)), 1e-9)
        # Logarithmic over four decades: a few strategies often hold nearly all of the variance.
        drawn = axes.imshow(np.clip(100 * table, 1e-4 * top, None), cmap="cividis", aspect="auto", norm=LogNorm(1e-4 * top, top))
        for i, k in enumerate(lengths):
            for j, s in enumerate(columns):
                share = 100 * table[i, j]
                if math.isfinite(share):
                    text = "0" if share == 0 else "<0.01" if share < 0.01 else style.short_number(share, 2)
                    axes.text(j, i, text + ("*" if (columns[j], k + 1 - columns[j]) in decided else ""), ha="center", va="center", fontsize=6.5, color="black" if share > 3e-2 * top else "white")
        axes.set_xticks(range(len(columns)), columns)
        axes.set_yticks(range(len(lengths)), lengths)
        axes.set_xlabel("s: vertices from the light")
        axes.set_ylabel("k: segments")
        figure.colorbar(drawn, label="% of the sum of variances", extend="min")
    yield style.Picture(
        style.file_name("strategy_variance", scene, run), figure, f"Variance of the strategies of {run} on {scene}",
        f"Unbiased variance over {max(n for *_, n, _ in found)} seeds of each weighted strategy's image, times spp, mean over pixels and channels, as a share of the sum over "
        f"strategies. Strategies share subpaths, so that the sum is not the variance of the image. {'A star: one pixel holds half of it or more, so that a single bright sample decides and other seeds will tell otherwise. ' if decided else ''}Values, from three seeds on with jackknife intervals: strategy_variance.csv.",
        [run], [scene])
