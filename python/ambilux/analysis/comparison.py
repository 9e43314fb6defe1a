"""Comparison figure: the reference, insets of every run with their error figures, and error maps.

Drawn by matplotlib. figuregen (Niemann), the usual tool for this layout, writes PDF by pdflatex only, which the set-up would have to install,
and its HTML is a grid of pictures that report.html surpasses.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

from ambilux.analysis import images, style
from ambilux.analysis.experiment import InputError

BESIDE = 6  # runs beside the reference; more stand below it
ACROSS = 7
HIGHEST = 8.6  # inches of a figure, beside a caption on a page
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
    return f"relMSE {style.short_number(last.relative_error)}\nRMSE {style.short_number(last.error)}\n{last.spp} spp\n{style.short_number(last.time)} s"


def add_scale(figure, axes, highest, width):
    """The colours of the error maps, below a title of at most `width` inches."""
    figure.colorbar(ScalarMappable(Normalize(0, highest), style.ERROR_COLOURS), cax=axes, orientation="horizontal", extend="max")
    axes.tick_params(labelsize=6.5)
    axes.set_title(style.fit("relative error |x − r| / (|r| + 0.01)", width, 7), fontsize=7, pad=3)


def draw(experiment, scene, reference, shown, insets):
    """`shown`: [(run, seed, image)]: two insets of each, its error map and its numbers, beside the reference or, of more than BESIDE runs, in even rows below it.
    One exposure and one colour scale for all."""
    height, width = reference.shape[:2]
    factor, rows = images.exposure(reference), len(insets)
    below = len(shown) > BESIDE
    across = style.balanced(len(shown), ACROSS) if below else len(shown) + 1
    unit = style.PAGE / (across + rows * width / height + 0.15)  # inches of an inset; the reference is as high as all of them
    apart = style.PAGE / across if below else unit  # columns, spread over the page
    points = 7.5 if apart > 0.9 else 6.5
    headings = [style.fit(run, apart, points) for run, _, _ in shown]
    title, numbers = 0.08 + 0.12 * (max(h.count("\n") for h in headings) + 1), 0.46
    if below:  # as large as a page has room for
        blocks = -(-len(shown) // across)
        unit = min(style.PAGE / ACROSS, max(0.5, (HIGHEST - 0.5 - blocks * (title + 0.02 + numbers)) / (rows + blocks * (rows + height / width))))
    gap, big_width, map_height = 0.03, rows * unit * width / height, unit * height / width
    maps = [images.relative_error(image, reference) for _, _, image in shown]
    highest = images.highest_of(maps)
    name = style.fit(f"{scene}, reference", big_width, 8.5)
    big_title = 0.08 + 0.14 * (name.count("\n") + 1)
    title = title if below else max(title, big_title)
    block = title + rows * unit + 0.02 + map_height + numbers
    head = big_title + rows * unit + 0.1 if below else 0.0
    total = head + block * (-(-len(shown) // across)) if below else block + (0.25 if map_height < 0.25 else 0)
    with plt.rc_context(style.STYLE):
        figure = plt.figure(figsize=(style.PAGE, total))

        def place(x, y, w, h):  # inches from the top left
            return figure.add_axes((x / style.PAGE, 1 - (y + h) / total, w / style.PAGE, h / total))

        def put_insets(image, heading, x, y):
            for row, ((ix, iy, size), colour) in enumerate(zip(insets, INSET_COLOURS)):
                axes = place(x, y + row * unit, unit - gap, unit - gap)
                axes.imshow(images.tone_map(image[iy:iy + size, ix:ix + size], factor), interpolation="nearest")
                bare(axes, colour)
                if row == 0:
                    axes.set_title(heading, pad=3, fontsize=points)

        top = big_title if below else title
        big = place(0, top, big_width, rows * unit)
        big.imshow(images.tone_map(reference, factor), interpolation="nearest")
        big.set_title(name, pad=3)
        bare(big)
        for (x, y, size), colour in zip(insets, INSET_COLOURS):
            big.add_patch(Rectangle((x - 0.5, y - 0.5), size, size, fill=False, lw=1.2, ec=colour))
        left = big_width + 0.1
        put_insets(reference, "reference", left, top)
        for i, (run, seed, image) in enumerate(shown):
            x = i % across * apart + (apart - unit) / 2 if below else left + (i + 1) * unit
            y = head + (i // across) * block + title if below else top
            put_insets(image, headings[i], x, y)
            axes = place(x, y + rows * unit + 0.02, unit - gap, map_height)
            axes.imshow(maps[i], cmap=style.ERROR_COLOURS, vmin=0, vmax=highest, interpolation="nearest")
            bare(axes)
            axes.set_xlabel(numbers_below(experiment, scene, run, seed), fontsize=6, labelpad=2)
        room = style.PAGE - left - unit if below else big_width
        bar = (place(left + unit + 0.15 * room, top + 0.45 * rows * unit, 0.7 * room, 0.09) if below
               else place(big_width * 0.2, top + rows * unit + 0.02 + max(map_height / 2, 0.2), big_width * 0.6, 0.09))
        add_scale(figure, bar, highest, 1.2 * room)
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
    height, width = reference.shape[:2]
    for x, y, size in insets or []:
        if x + size > width or y + size > height:
            raise InputError(f"--inset {scene}={x},{y},{size}: the image has {width}x{height} pixels")
    chosen = insets or choose_insets(reference, [image for _, _, image in shown])
    how = "chosen by hand" if insets else "chosen where the runs' errors differ most from each other and the reference has contrast"
    yield style.Picture(
        style.file_name("comparison", scene), draw(experiment, scene, reference, shown, chosen), f"Comparison on {scene}",
        f"Insets (pixels x, y, size: {'; '.join(', '.join(map(str, i)) for i in chosen)}; {how}) and error maps of the images at the last checkpoint, seeds "
        f"{', '.join(f'{seed} ({run})' for run, seed, _ in shown)}. Shown at {style.short_number(images.exposure(reference))} times the radiance, sRGB. One colour "
        "scale for all maps; the brightest 1 % are cut. The figures are the runner's, for the image shown, with the noise of the reference subtracted where known.",
        [run for run, _, _ in shown], [scene])
