"""Variance of strategies on noise of known variance."""

import math

import numpy as np
import pytest

from ambilux.analysis import strategy_variance as sv


def test_variance_of_one_sample_is_unbiased_and_needs_no_reference():
    rng = np.random.default_rng(43)
    values = [sv.variance_of_one_sample(5 + rng.normal(0, 3 / math.sqrt(16), size=(3, 20)), 16) for _ in range(2000)]
    assert np.mean(values) == pytest.approx(9, rel=4 * math.sqrt(2 / (2 * 20) / 2000))
    with pytest.raises(ValueError):
        sv.variance_of_one_sample(np.zeros((1, 4)), 1)


def test_interval_covers_although_pixels_are_correlated():
    """Neighbours share their noise, as splats of one light path do: a count over pixels would be too sure of itself."""
    rng = np.random.default_rng(47)
    trials, covered = 600, 0
    for _ in range(trials):
        shared = np.repeat(rng.normal(0, 2, size=(10, 40)), 5, axis=1)
        e = sv.strategy_variance(shared, 1)
        covered += e.low <= 4 <= e.high
    assert 0.91 < covered / trials < 0.98  # the jackknife of a skewed statistic: close to 95 %, not exactly


def test_value_is_the_mean_of_pseudo_values_and_few_seeds_are_told():
    x = np.array([[1.0, 2.0], [3.0, 5.0], [4.0, 4.0]])
    assert sv.strategy_variance(x, 2).value == pytest.approx(2 * x.var(axis=0, ddof=1).mean())
    assert math.isnan(sv.strategy_variance(x[:2], 2).error)
    assert math.isnan(sv.strategy_variance(x[:1], 2).value)


def test_seeds_of_different_numbers_of_samples_weigh_by_them():
    """As with a budget in seconds: unbiased whatever the numbers, while their plain variance is not."""
    rng, spp = np.random.default_rng(4), np.array([4, 9, 30])
    images = [[rng.normal(1.0, 2.0 / np.sqrt(n), size=50) for n in spp] for _ in range(400)]
    found = [sv.variance_of_one_sample(i, spp) for i in images]
    # 50 pixels, 2 degrees of freedom: relative variance 2 / 100, over 400 trials.
    assert np.mean(found) == pytest.approx(4.0, abs=4 * 4.0 * np.sqrt(0.02 / 400))
    same = np.array(images[0])
    assert sv.variance_of_one_sample(same, [8, 8, 8]) == pytest.approx(8 * same.var(axis=0, ddof=1).mean())


def test_a_single_bright_sample_is_told():
    rng = np.random.default_rng(6)
    x = rng.normal(size=(2, 8, 9, 3))
    assert sv.largest_pixel(x, [10, 20]) < 0.2
    x[1, 3, 4] += 1000
    assert sv.largest_pixel(x, [10, 20]) > 0.999
    assert math.isnan(sv.largest_pixel(np.ones((2, 3, 3, 3)), 1))
