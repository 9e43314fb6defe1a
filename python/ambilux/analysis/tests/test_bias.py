"""The bias test on normal data: level, power, and the reference's noise."""

import math

import numpy as np
import pytest

from ambilux.analysis import bias


def trial(rng, shift=0.0, own=1.0, reference=0.7, seeds=4, pixels=0, dependence=1.0):
    """`pixels`: the scores of seeds are those of so many pixels, as the runner records them, too large by `dependence`."""
    if not pixels:
        return bias.bias_test(shift + rng.normal(0, own, seeds) - rng.normal(0, reference), reference)
    scale = math.sqrt(pixels)  # of one pixel over that of the mean
    d = shift + rng.normal(0, own * scale, (seeds, pixels)) - rng.normal(0, reference * scale, pixels)
    scores = d.sum(1) / np.sqrt((d**2).sum(1))
    if dependence != 1.0:
        d = shift + dependence * (d - shift)
    return bias.bias_test(d.mean(1), reference, scores)


@pytest.mark.parametrize("own,reference", [(1.0, 0.0), (1.0, 0.7), (0.05, 1.0)])
def test_level_and_coverage_hold_although_seeds_share_the_reference(own, reference):
    rng = np.random.default_rng(29)
    tests = [trial(rng, 0.0, own, reference) for _ in range(3000)]
    false_alarms = np.mean([t.p < 0.05 for t in tests])
    # Satterthwaite's is an approximation: a point above the binomial error is allowed.
    assert abs(false_alarms - 0.05) < 4 * math.sqrt(0.05 * 0.95 / 3000) + 0.01
    assert np.mean([t.estimate.low <= 0 <= t.estimate.high for t in tests]) == pytest.approx(1 - false_alarms, abs=1e-9)


@pytest.mark.parametrize("own,reference", [(1.0, 0.0), (1.0, 0.25), (1.0, 0.7), (0.3, 1.0)])
@pytest.mark.parametrize("seeds", [2, 3])
def test_few_seeds_that_agree_by_chance_are_not_found_biased(own, reference, seeds):
    """At levels such as those of many tests together, where Student's t alone is past 0.001 in up to 4 % of the trials."""
    rng = np.random.default_rng(43)
    for dependence in (1.0, 1.3) if reference == 0 else (1.0,):
        p = np.array([trial(rng, 0.0, own, reference, seeds, 100, dependence).p for _ in range(4000)])
        for level in (0.05, 0.01, 0.001):
            assert np.mean(p < level) < level + 4 * math.sqrt(level * (1 - level) / len(p))
    if reference == 0.25 and seeds == 2:
        assert np.mean([trial(rng, 0.0, own, reference, seeds).p < 0.001 for _ in range(2000)]) > 0.02
    # Two seeds that differ by more than their pixels say leave one degree of freedom; what they miss, their single z finds.
    assert np.mean([trial(rng, 6 * math.hypot(own, reference), own, reference, seeds, 1000).p < 0.01 for _ in range(300)]) > 0.6


def test_ignoring_the_reference_noise_would_cry_wolf():
    rng = np.random.default_rng(31)
    wrong = [bias.bias_test(rng.normal(0, 0.05, 4) - rng.normal(0, 1.0), 0.0).p < 0.05 for _ in range(500)]
    assert np.mean(wrong) > 0.5


def test_a_bias_is_found():
    rng = np.random.default_rng(37)
    for pixels in 0, 1000:
        assert np.mean([trial(rng, shift=6.0, own=1.0, reference=0.7, pixels=pixels).p < 0.01 for _ in range(300)]) > 0.9


def test_by_hand():
    t = bias.bias_test([1.0, 3.0], 0.0)  # mean 2, s^2 = 2, se 1, one degree of freedom: Cauchy
    assert (t.estimate.value, t.estimate.error, t.degrees) == (2, pytest.approx(1), pytest.approx(1))
    assert t.p == pytest.approx(1 - 2 / math.pi * math.atan(2))
    assert bias.bias_test([1.0], 0.1) is None
    assert bias.bias_test([0.0, 0.0], 0.0).p == 1
    assert bias.bias_test([1.0, 1.0], 0.5).estimate.error == pytest.approx(0.5)


def test_reference_mean_error_bounds_the_simulated_one():
    rng = np.random.default_rng(41)
    pixels = 50
    se = rng.uniform(0.1, 2.0, size=(pixels, 1)) * np.ones((1, 3))
    noise = math.sqrt((se**2).mean())
    grey = (rng.normal(size=(4000, pixels, 1)) * se).mean(axis=(1, 2))  # channels move together: the bound is met
    assert grey.std() == pytest.approx(bias.reference_mean_error(noise, pixels), rel=0.05)
    colour = (rng.normal(size=(4000, pixels, 3)) * se).mean(axis=(1, 2))
    assert colour.std() < bias.reference_mean_error(noise, pixels)
