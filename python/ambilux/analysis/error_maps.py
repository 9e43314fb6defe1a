"""False-colour maps: where the error of one image lies, and where the mean over seeds is too bright or too dark."""

import matplotlib.pyplot as plt
import numpy as np

from ambilux.analysis import comparison, images, style

BLOCK = 4  # pixels: of the signed map
ACROSS = 7


def mean_image(experiment, scene, run, reference):
    """Mean over the images of all seeds, and their number."""
    paths = [p for _, p in experiment.files("images", scene, run, ".exr")]
    total = np.zeros(reference.shape)
    for path in paths:
        total += images.read_like(path, reference)
    return total / len(paths), len(paths)


def draw(scene, reference, columns):
    """`columns`: [(run, error map, signed map, seeds)]. Pairs of rows, errors above; one scale for all errors and one for all signed maps."""
    height, width = reference.shape[:2]
    highest = images.highest_of([c[1] for c in columns])
    signed = images.highest_of([np.abs(c[2]) for c in columns], 98)
    across = style.balanced(len(columns), ACROSS)
    blocks = -(-len(columns) // across)
    cell = min(2.2, (style.PAGE - 0.1) / across)
    points = 8.5 if cell > 1.3 else 7
    lines = max(style.fit(run, cell, points).count("\n") + 1 for run, *_ in columns)
    with plt.rc_context(style.STYLE):
        figure, grid = plt.subplots(2 * blocks, across, figsize=(max(cell * across, style.COLUMN), blocks * (2 * cell * height / width + 0.25 + 0.15 * lines) + 1.1), squeeze=False,
                                    layout="constrained")
        for axes in grid.flat:
            axes.set_axis_off()
        for i, (run, error, difference, _) in enumerate(columns):
            above, below = grid[2 * (i // across)][i % across], grid[2 * (i // across) + 1][i % across]
            top = above.imshow(error, cmap=style.ERROR_COLOURS, vmin=0, vmax=highest, interpolation="nearest")
            bottom = below.imshow(difference, cmap=style.SIGNED_COLOURS, vmin=-signed, vmax=signed, interpolation="nearest")
            above.set_title(style.fit(run, cell, points), fontsize=points)
            for axes in above, below:
                axes.set_axis_on()
                comparison.bare(axes)
        figure.get_layout_engine().set(rect=(0, 0, 1, 1 - 0.08 / figure.get_figheight()))  # headings of several lines
        figure.colorbar(bottom, ax=list(grid.flat), location="bottom", extend="both", label="signed relative error (x − r) / (|r| + 0.01), mean over seeds", shrink=0.6, aspect=40)
        figure.colorbar(top, ax=list(grid.flat), location="bottom", extend="max", label="relative error |x − r| / (|r| + 0.01)", shrink=0.6, aspect=40)
    return figure


def make(experiment, scene):
    """Yields the scene's figures."""
    reference, shown = comparison.load(experiment, scene)
    columns = []
    for run, _, image in shown:
        mean, seeds = mean_image(experiment, scene, run, reference)
        difference = images.signed_error(images_blocks(mean), images_blocks(reference))
        columns.append((run, images.relative_error(image, reference), difference, seeds))
    yield style.Picture(
        style.file_name("errors", scene), draw(scene, reference, columns), f"Error maps of {scene}",
        "Above: |x − r| / (|r| + 0.01), mean of the channels, of one seed's image at the last checkpoint. Below: (x − r) / (|r| + 0.01) of the mean over seeds "
        f"({', '.join(f'{run}: {seeds}' for run, _, _, seeds in columns)}), over blocks of {BLOCK}x{BLOCK} pixels; purple is too bright, orange too dark. Without "
        "bias it is patternless noise. The brightest 1 % (above) and 2 % (below) are cut.",
        [c[0] for c in columns], [scene])


def images_blocks(image):
    """An image of the means of its blocks, shape (rows, columns, 3)."""
    return np.stack([images.block_means(np.asarray(image[..., c], dtype=float), BLOCK) for c in range(3)], axis=-1)
