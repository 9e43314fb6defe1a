"""Colours of the figures, as the colour-blind and a grey printer show them."""

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_rgb

from ambilux.analysis import comparison, style
from ambilux.analysis.tests import colour_vision

KINDS = list(colour_vision.MACHADO)
LINES = np.array([to_rgb(c) for c in style.COLOURS])


def test_simulation_keeps_grey_and_confuses_red_with_green():
    greys = np.linspace(0, 1, 5)[:, None] * np.ones(3)
    red_and_green = np.array([[0.8, 0.25, 0.2], [0.45, 0.45, 0.1]])
    for kind in KINDS:
        assert colour_vision.simulate(greys, kind) == pytest.approx(greys, abs=0.01)
    assert colour_vision.distances(colour_vision.simulate(red_and_green, "deuteranopia"))[0] < 0.5 * colour_vision.distances(red_and_green)[0]
    assert colour_vision.lab(np.ones(3)) == pytest.approx([100, 0, 0], abs=0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_lines_are_told_apart(kind):
    # Markers differ too; 10 is more than four times what is just noticeable.
    assert min(colour_vision.distances(colour_vision.simulate(LINES, kind))) > 10


def test_markers_and_hatches_differ_where_grey_does_not():
    assert len(set(style.MARKERS)) == len(style.MARKERS) == len(style.COLOURS) == len(set(style.HATCHES))


@pytest.mark.parametrize("kind", [None, *KINDS])
def test_error_maps_grow_brighter_with_the_error(kind):
    colours = colormaps[style.ERROR_COLOURS](np.linspace(0, 1, 64))[:, :3]
    lightness = colour_vision.lab(colour_vision.simulate(colours, kind) if kind else colours)[:, 0]
    assert (np.diff(lightness) > 0).all() and lightness[-1] - lightness[0] > 80


@pytest.mark.parametrize("kind", [None, *KINDS])
def test_signed_maps_tell_too_bright_from_too_dark(kind):
    ends = colormaps[style.SIGNED_COLOURS](np.array([0.2, 0.8]))[:, :3]
    assert colour_vision.distances(colour_vision.simulate(ends, kind) if kind else ends)[0] > 40


@pytest.mark.parametrize("kind", KINDS)
def test_frames_of_insets_are_told_apart(kind):
    frames = np.array([to_rgb(c) for c in comparison.INSET_COLOURS])
    assert colour_vision.distances(colour_vision.simulate(frames, kind))[0] > 20
