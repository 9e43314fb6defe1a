"""Time to equal error on curves with known answers."""

import math

import numpy as np
import pytest

from ambilux.analysis import equal_error


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
    base, run = (t, 3 / np.sqrt(t)), (t, 1 / np.sqrt(t))
    s = equal_error.speedup(base, run)
    assert s.value == pytest.approx(9) and s.sign == "" and s.target == pytest.approx(0.75)
    assert s.extrapolated == pytest.approx(1)  # 16/9 s lies between its checkpoints
    assert equal_error.speedup(run, base).value == pytest.approx(1 / 9)
    assert equal_error.speedup(base, (t, 0 * t)) is None


def test_beyond_a_factor_of_four_there_is_a_bound_and_no_number():
    """The faster run was below the target at its first checkpoint: by how much sooner it was nobody measured."""
    t = np.array([1.0, 2])
    slow, fast = (t, 100 / np.sqrt(t)), (t, 1 / np.sqrt(t))
    s = equal_error.speedup(slow, fast)
    assert (s.sign, s.value) == (">", pytest.approx(2)) and s.extrapolated == pytest.approx(5000)
    s = equal_error.speedup(fast, slow)
    assert (s.sign, s.value) == ("<", pytest.approx(0.5))
    near = (t, 55 / np.sqrt(t))  # 100 / sqrt 2 is 1.65 times nearer: within the factor
    assert equal_error.speedup(slow, near).sign == "" and equal_error.speedup(slow, near).value == pytest.approx((100 / 55) ** 2)
