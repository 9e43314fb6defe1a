"""Gains that scripts/bench/tile_bound.py finds in figures whose best numbers are known."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[4] / "scripts" / "bench"))

import tile_bound  # noqa: E402

CANDIDATES = 1 + len(tile_bound.DRAWS) * len(tile_bound.LIGHT)


def scene(variance, cost):
    """A film of two tiles with mean 1. By candidate: variance of each tile, cost of a sample."""
    pixels = np.repeat(np.asarray(variance, float), 8, axis=1)[:, None, None, :, None]  # candidate, half, y, x, channel
    shape = (CANDIDATES, 2, 8, 16, 3)
    return {"mean": np.ones(shape), "variance": np.broadcast_to(pixels, shape), "cost": np.repeat(cost, 2).reshape(-1, 2),
            "spp": np.full((CANDIDATES, 2), 64), "tile_cost": np.ones((4, 1, 2))}


def test_eye_samples_follow_the_root_of_the_variance():
    gains = tile_bound.Scene(scene([[16, 1]] * CANDIDATES, np.ones(CANDIDATES)), 0).table()[1]
    best = 8.5 / 2.5**2  # mean over the squared mean of roots
    assert gains == pytest.approx([1, best, best], rel=1e-3)


def test_draws_are_made_where_they_help():
    # 16 draws cost three times as much and have a sixteenth of the variance in the first tile only.
    draws = np.repeat([0, *tile_bound.DRAWS], [1] + [len(tile_bound.LIGHT)] * len(tile_bound.DRAWS))
    variance = [[1 if d == 16 else 16, 1] for d in draws]
    cost = np.where(draws == 16, 3.0, np.where(draws == 4, 1.4, 1.0))
    name, gains = tile_bound.Scene(scene(variance, cost), 0).table()
    assert name == "16 draws, 0.0625"
    assert gains[0] == pytest.approx(3 * 1 / (2 * 1), rel=0.01)
    assert gains[2] >= gains[0]
