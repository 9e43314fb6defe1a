"""False-colour maps: where the error of one image lies, and where the mean over seeds is too bright or too dark."""

import matplotlib.pyplot as plt
import numpy as np

from analysis import comparison, images, style

BLOCK = 4  # pixels: of the signed map
PER_FIGURE = 5


def mean_image(experiment, scene, run, reference):
    """Mean over the images of all seeds, and their number."""
    paths = [p for _, p in experiment.files("images", scene, run, ".exr")]
    total = np.zeros(reference.shape)
    for path in paths:
        total += images.read_like(path, reference)
    return total / len(paths), len(paths)


def draw(scene, reference, columns):
    """`columns`: [(run, error map, signed map, seeds)]. Two rows, each with one scale."""
    height, width = reference.shape[:2]
    highest = images.highest_of([c[1] for c in columns])
    signed = images.highest_of([np.abs(c[2]) for c in columns], 98)
    across = len(columns)
    cell = min(2.2, (style.PAGE - 0.75) / across)
    with plt.rc_context(style.STYLE):
        figure, grid = plt.subplots(2, across, figsize=(cell * across + 0.75, 2 * cell * height / width + 0.55), squeeze=False, layout="constrained")
        for column, (run, error, difference, _) in enumerate(columns):
            top = grid[0][column].imshow(error, cmap=style.ERROR_COLOURS, vmin=0, vmax=highest, interpolation="nearest")
            bottom = grid[1][column].imshow(difference, cmap=style.SIGNED_COLOURS, vmin=-signed, vmax=signed, interpolation="nearest")
            grid[0][column].set_title(style.wrap(run))
            for axes in grid[:, column]:
                comparison.bare(axes)
        figure.colorbar(top, ax=list(grid[0]), extend="max", label="relative error", fraction=0.05, aspect=14)
        figure.colorbar(bottom, ax=list(grid[1]), extend="both", label="signed", fraction=0.05, aspect=14)
    return figure


def make(experiment, scene):
    """Yields the scene's figures."""
    reference, shown = comparison.load(experiment, scene)
    columns = []
    for run, _, image in shown:
        mean, seeds = mean_image(experiment, scene, run, reference)
        difference = images.signed_error(images_blocks(mean), images_blocks(reference))
        columns.append((run, images.relative_error(image, reference), difference, seeds))
    for part in range(0, len(columns), PER_FIGURE):
        some = columns[part:part + PER_FIGURE]
        yield style.Picture(
            f"errors_{scene}" + (f"_{part // PER_FIGURE + 1}" if part else ""), draw(scene, reference, some), f"Error maps of {scene}",
            "Above: |x − r| / (|r| + 0.01), mean of the channels, of one seed's image at the last checkpoint. Below: (x − r) / (|r| + 0.01) of the mean over seeds "
            f"({', '.join(f'{run}: {seeds}' for run, _, _, seeds in some)}), over blocks of {BLOCK}x{BLOCK} pixels; purple is too bright, orange too dark. Without "
            "bias it is patternless noise. The brightest 1 % (above) and 2 % (below) are cut.",
            [c[0] for c in some], [scene])


def images_blocks(image):
    """An image of the means of its blocks, shape (rows, columns, 3)."""
    return np.stack([images.block_means(np.asarray(image[..., c], dtype=float), BLOCK) for c in range(3)], axis=-1)
