"""Speed-up at equal error on curves with known answers."""

import math

import numpy as np
import pytest

from analysis import equal_error


def test_budget_is_interpolated_in_logarithms():
    n = np.array([1, 4, 16, 64])
    assert equal_error.budget_at_error(n, 2 / np.sqrt(n), 2 / math.sqrt(8)) == (pytest.approx(8), 1.0)
    assert equal_error.budget_at_error(n, 2 / n, 0.25) == (pytest.approx(8), 1.0)  # whatever the slope
    assert equal_error.budget_at_error(n, 2 / np.sqrt(n), 0.25)[0] == pytest.approx(64)  # a checkpoint itself


def test_budget_outside_follows_the_slope_of_independent_samples():
    n = np.array([1, 4, 16])
    assert equal_error.budget_at_error(n, 2 / np.sqrt(n), 0.1) == (pytest.approx(400), pytest.approx(25))
    assert equal_error.budget_at_error(n, 2 / np.sqrt(n), 4.0) == (pytest.approx(0.25), pytest.approx(4))


def test_a_lucky_dip_does_not_count():
    assert equal_error.budget_at_error([1, 2, 4, 8], [1.0, 0.1, 0.5, 0.25], 0.4)[0] > 4
    assert equal_error.budget_at_error([1, 2, 4], [1.0, 0.1, 0.5], 0.25)[0] == pytest.approx(16)  # has not reached it yet


def test_unusable_points_are_left_out():
    assert equal_error.budget_at_error([4, 1, 2, 8], [0.5, 1.0, math.nan, 0.0], 0.5)[0] == pytest.approx(4)
    assert math.isnan(equal_error.budget_at_error([1], [0.0], 0.5)[0])


def test_exact_curves_give_the_exact_speedup():
    t = np.array([1.0, 2, 4, 8, 16])
    base = {s: (t, 3 / np.sqrt(t)) for s in (1, 2, 3)}
    run = {s: (t, 1 / np.sqrt(t)) for s in (2, 3, 4)}
    s = equal_error.speedup(base, run)
    assert s.estimate.value == pytest.approx(9) and s.pairs == 2 and s.target == pytest.approx(0.75)
    assert s.estimate.low == pytest.approx(9)
    assert s.extrapolated == pytest.approx(1)  # 16/9 s lies between its checkpoints
    assert equal_error.speedup(base, {9: (t, t)}) is None
    assert equal_error.speedup(run, base).estimate.value == pytest.approx(1 / 9)


def test_far_extrapolation_is_told():
    t = np.array([1.0, 2])
    s = equal_error.speedup({1: (t, 100 / np.sqrt(t))}, {1: (t, 1 / np.sqrt(t))})
    assert s.estimate.value == pytest.approx(10000) and s.extrapolated == pytest.approx(5000)


def test_interval_covers_the_truth_for_cumulative_checkpoints():
    """RMSE of running means, as of renders whose checkpoints share samples: method b needs 4 times fewer samples."""
    rng = np.random.default_rng(23)
    n, pixels, trials, seeds = np.array([8, 16, 32, 64, 128]), 30, 500, 4

    def curves(sigma):
        means = rng.normal(0, sigma, size=(seeds, n[-1], pixels)).cumsum(axis=1)[:, n - 1] / n[:, None]
        return {s: (n, np.sqrt((m**2).mean(axis=1))) for s, m in enumerate(means)}

    intervals = [equal_error.speedup(curves(1.0), curves(0.5)).estimate for _ in range(trials)]
    covered = sum(e.low <= 4 <= e.high for e in intervals) / trials
    assert abs(covered - 0.95) < 4 * math.sqrt(0.95 * 0.05 / trials)
    assert np.exp(np.mean([math.log(e.value) for e in intervals])) == pytest.approx(4, rel=0.05)
