"""FLIP: the difference that a viewer sees when flipping between image and reference.

HDR-FLIP (Andersson, Nilsson, Shirley and Akenine-Möller 2021, "Visualizing errors in rendered high dynamic range images", Eurographics short
papers) by its authors' program, package flip-evaluator, with its default viewing conditions (67 pixels per degree) and exposures.
"""

import os
from functools import lru_cache

import matplotlib.pyplot as plt
import numpy as np

from ambilux.analysis import comparison, hdr_data, images, style
from ambilux.analysis.experiment import InputError

# Threads of OpenMP that wait do not keep others from running; read when the library is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
try:
    import flip_evaluator
except ImportError:
    flip_evaluator = None

ACROSS = 7


def flip(image, reference):
    """(map in [0, 1] of shape (height, width), mean). NaN, Inf and negative values, which FLIP does not know, count as zero."""
    if images.is_black(reference):  # HDR-FLIP finds no exposure for it, and would end the program
        raise style.NotMade("the reference is black")
    clean = [np.ascontiguousarray(np.clip(np.nan_to_num(x, posinf=0.0, neginf=0.0), 0, None), dtype=np.float32) for x in (reference, image)]
    values, mean, _ = flip_evaluator.evaluate(*clean, "HDR", applyMagma=False)
    return np.asarray(values, dtype=np.float32).reshape(reference.shape[:2]), float(mean)


def of_files(image, reference, factor=1):
    """flip of two files, shrunk by hdr_data.shrink, the map in 8 bits. Kept, because a figure and the page want the same."""
    return kept(image, reference, factor)


@lru_cache(maxsize=256)
def kept(image, reference, factor):
    pair = [hdr_data.shrink(p, factor) for p in (images.read_exr(image), images.read_exr(reference))]
    values, mean = flip(*pair)
    return (np.clip(values, 0, 1) * 255 + 0.5).astype(np.uint8), mean


def of_runs(experiment):
    """{(scene, run): (mean over pixels, median over pixels)}, means over the images of all seeds; {} without the package. Broken files are told by the figures."""
    out = {}
    for scene in experiment.scenes if flip_evaluator is not None else ():
        reference = experiment.reference(scene)
        for run in experiment.runs if reference else ():
            try:
                found = [of_files(path, reference) for _, path in experiment.files("images", scene, run, ".exr")]
            except (InputError, ValueError, style.NotMade):
                continue
            if found:
                out[scene, run] = (float(np.mean([mean for _, mean in found])), float(np.mean([np.median(values) / 255 for values, _ in found])))
    return out


def draw(scene, shape, columns):
    height, width = shape
    across = style.balanced(len(columns), ACROSS)
    rows = -(-len(columns) // across)
    cell = min(2.2, (style.PAGE - 0.6) / across)
    points = 8.5 if cell > 1.3 else 7
    lines = max(style.fit(run, cell, points).count("\n") + 2 for run, *_ in columns)
    with plt.rc_context(style.STYLE):
        figure, grid = plt.subplots(rows, across, figsize=(cell * across + 0.6, rows * (cell * height / width + 0.16 + 0.15 * lines)), squeeze=False, layout="constrained")
        for axes in grid.flat:
            axes.set_axis_off()
        for axes, (run, values, mean) in zip(grid.flat, columns):
            drawn = axes.imshow(values / 255, cmap=style.ERROR_COLOURS, vmin=0, vmax=1, interpolation="nearest")
            median = f", median {np.median(values) / 255:.3f}" if cell > 1.6 else ""
            axes.set_title(f"{style.fit(run, cell, points)}\nmean {mean:.3f}{median}", fontsize=points)
            axes.set_axis_on()
            comparison.bare(axes)
        figure.colorbar(drawn, ax=list(grid.flat), label="HDR-FLIP", fraction=0.05, aspect=14)
    return figure


def make(experiment, scene):
    """Yields the scene's figures."""
    if flip_evaluator is None:
        raise style.NotMade("the package flip-evaluator is not installed (pip install flip-evaluator)")
    reference, shown = comparison.load(experiment, scene)
    columns = [(run, *of_files(experiment.image(scene, run)[1], experiment.reference(scene))) for run, _, _ in shown]
    yield style.Picture(
        style.file_name("flip", scene), draw(scene, reference.shape[:2], columns), f"FLIP of {scene}",
        "HDR-FLIP (Andersson et al. 2021) between the image of the lowest seed at the last checkpoint and the reference, 67 pixels per degree; 0: no visible "
        f"difference. Means: {'; '.join(f'{run} {mean:.4f}' for run, _, mean in columns)}.",
        [c[0] for c in columns], [scene])
