"""Comparison figure: the reference, insets of every run with their error figures, and error maps.

Drawn by matplotlib. figuregen (Niemann), the usual tool for this layout, writes PDF by pdflatex only, which the set-up would have to install,
and its HTML is a grid of pictures that report.html surpasses.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

from analysis import images, style

RUNS_PER_FIGURE = 5
INSETS = 2
INSET_COLOURS = (style.COLOURS[1], style.COLOURS[4])  # vermilion and sky blue: told apart in grey too


def choose_insets(reference, renderings, count=INSETS):
    """(x, y, size) of the square windows in which the renderings' errors differ most from each other and there is something to see; they lie half their size apart or more.

    Score of a window: standard deviation over runs of log(mean relative error + 0.05), times 0.1 + the standard deviation of the reference's grey as shown,
    so that of two windows that tell the methods apart alike the one with an edge or a highlight wins over the bare wall. Candidates lie on a grid of a third of their size.
    """
    height, width = reference.shape[:2]
    size = max(4, min(height, width) // 4)
    maps = [np.nan_to_num(images.relative_error(p, reference), posinf=1.0) for p in renderings]
    step = max(1, size // 3)
    grey = images.tone_map(reference, images.exposure(reference)).mean(axis=2) / 255
    scored = []
    for y in range(0, height - size + 1, step):
        for x in range(0, width - size + 1, step):
            errors = [float(m[y:y + size, x:x + size].mean()) for m in maps]
            score = np.std(np.log(np.array(errors) + 0.05)) if len(errors) > 1 else errors[0]
            contrast = float(grey[y:y + size, x:x + size].std())
            scored.append((-float(score) * (0.1 + contrast), x, y))
    chosen = []
    for _, x, y in sorted(scored):
        if all(abs(x - a) >= 1.5 * size or abs(y - b) >= 1.5 * size for a, b, _ in chosen):
            chosen.append((x, y, size))
        if len(chosen) == count:
            break
    return chosen


def bare(axes, colour=None):
    """No ticks; a frame in `colour`, or none."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(colour is not None)
        spine.set_color(colour)
        spine.set_linewidth(1.2)


def numbers_below(experiment, scene, run, seed):
    """What was recorded for the image that is shown: its seed's last checkpoint."""
    rows = [r for r in experiment.select(scene, run) if r.seed == seed]
    if not rows:
        return ""
    last = rows[-1]
    return f"RMSE {style.short_number(last.error)}\nrelMSE {style.short_number(last.relative_error)}\n{last.spp} spp, {style.short_number(last.time)} s"


def draw(experiment, scene, reference, shown, insets):
    """`shown`: [(run, seed, image)]. A row of error maps below the insets."""
    height, width = reference.shape[:2]
    factor = images.exposure(reference)
    rows, columns = len(insets), len(shown) + 1
    unit = style.PAGE / (columns + rows * width / height + 0.15)  # inches of an inset: the reference is as high as all insets
    with plt.rc_context(style.STYLE):
        map_height = unit * height / width
        top = 0.1 + 0.11 * max(style.wrap(run, 16).count("\n") + 1 for run, _, _ in shown)
        figure = plt.figure(figsize=(style.PAGE, top + rows * unit + max(map_height, 0.3) + 0.46))
        total = figure.get_figheight()

        def place(x, y, w, h):  # inches from the top left
            return figure.add_axes((x / style.PAGE, 1 - (y + h) / total, w / style.PAGE, h / total))

        gap = 0.03
        big_width = rows * unit * width / height
        big = place(0, top, big_width, rows * unit)
        big.imshow(images.tone_map(reference, factor), interpolation="nearest")
        big.set_title(f"{scene}, reference", pad=3)
        bare(big)
        for (x, y, size), colour in zip(insets, INSET_COLOURS):
            big.add_patch(Rectangle((x - 0.5, y - 0.5), size, size, fill=False, lw=1.2, ec=colour))
        left = big_width + 0.1
        maps = [images.relative_error(image, reference) for _, _, image in shown]
        highest = images.highest_of(maps)
        every = [(run, seed, image) for run, seed, image in shown] + [("reference", None, reference)]
        for column, (run, seed, image) in enumerate(every):
            x = left + column * unit
            for row, ((ix, iy, size), colour) in enumerate(zip(insets, INSET_COLOURS)):
                axes = place(x, top + row * unit, unit - gap, unit - gap)
                axes.imshow(images.tone_map(image[iy:iy + size, ix:ix + size], factor), interpolation="nearest")
                bare(axes, colour)
                if row == 0:
                    axes.set_title(style.wrap(run, 16), pad=3, fontsize=7.5)
            if seed is None:
                continue
            axes = place(x, top + rows * unit + 0.02, unit - gap, map_height)
            axes.imshow(maps[column], cmap=style.ERROR_COLOURS, vmin=0, vmax=highest, interpolation="nearest")
            bare(axes)
            axes.set_xlabel(numbers_below(experiment, scene, run, seed), fontsize=6.5, labelpad=3)
        bar = place(big_width * 0.25, top + rows * unit + 0.02 + map_height / 2, big_width * 0.6, 0.09)
        figure.colorbar(ScalarMappable(Normalize(0, highest), style.ERROR_COLOURS), cax=bar, orientation="horizontal", extend="max")
        bar.tick_params(labelsize=6.5)
        bar.set_title("relative error |x − r| / (|r| + 0.01)", fontsize=7, pad=3)
    return figure


def load(experiment, scene):
    """(reference, [(run, seed, image)]) of the lowest seeds, or NotMade."""
    path = experiment.reference(scene)
    if path is None:
        raise style.NotMade(f"{scene}: the reference image is not there")
    reference = images.read_exr(path)
    found = [(run, *entry) for run in experiment.runs if (entry := experiment.image(scene, run))]
    if not found:
        raise style.NotMade(f"{scene}: no images/{scene}/RUN_SEED.exr")
    return reference, [(run, seed, images.read_like(p, reference)) for run, seed, p in found]


def make(experiment, scene, insets=None):
    """Yields the scene's figures, RUNS_PER_FIGURE runs in each. `insets`: [(x, y, size)] in pixels, or None to choose them."""
    reference, shown = load(experiment, scene)
    chosen = insets or choose_insets(reference, [image for _, _, image in shown])
    how = "chosen by hand" if insets else "chosen where the runs' errors differ most from each other and the reference has contrast"
    for part in range(0, len(shown), RUNS_PER_FIGURE):
        some = shown[part:part + RUNS_PER_FIGURE]
        yield style.Picture(
            f"comparison_{scene}" + (f"_{part // RUNS_PER_FIGURE + 1}" if part else ""), draw(experiment, scene, reference, some, chosen), f"Comparison on {scene}",
            f"Insets (pixels x, y, size: {'; '.join(', '.join(map(str, i)) for i in chosen)}; {how}) and error maps of the images at the last checkpoint, seeds "
            f"{', '.join(f'{seed} ({run})' for run, seed, _ in some)}. Shown at {style.short_number(images.exposure(reference))} times the radiance, sRGB. One colour "
            "scale for all maps; the brightest 1 % are cut. The figures are the runner's, for the image shown, with the noise of the reference subtracted where known.",
            [run for run, _, _ in some], [scene])
