"""Statistics on data with known answers."""

import math

import numpy as np
import pytest
from scipy.stats import t as student

from ambilux.analysis import statistics as st


def test_mean_estimate_by_hand():
    e = st.mean_estimate([1, 2, 3, 4])
    assert e.value == 2.5
    assert e.error == pytest.approx(math.sqrt(5 / 3) / 2)
    assert e.high - e.value == pytest.approx(3.1824463 * e.error, rel=1e-6)


def test_mean_of_one_value_has_unknown_error():
    e = st.mean_estimate([3.0])
    assert e.value == 3 and math.isnan(e.error) and math.isnan(e.low)


def test_mean_interval_covers_the_truth_as_often_as_it_says():
    trials, n = 4000, 4
    rng = np.random.default_rng(7)
    estimates = [st.mean_estimate(rng.normal(2.0, 3.0, n)) for _ in range(trials)]
    covered = sum(e.low <= 2.0 <= e.high for e in estimates)
    # Binomial(4000, 0.95) has standard deviation 13.8; four of them. A normal quantile in place of Student's would cover 86 %.
    assert abs(covered - 0.95 * trials) < 4 * math.sqrt(trials * 0.95 * 0.05)


def test_ratio_of_pairs_is_exact_when_pairs_move_together():
    e = st.ratio_of_pairs([2, 20, 200], [1, 10, 100])
    assert (e.value, e.low, e.high) == pytest.approx((2, 2, 2))
    assert e.error == pytest.approx(0, abs=1e-12)


def test_ratio_of_pairs_by_hand():
    e = st.ratio_of_pairs([math.e, 1], [1, 1])  # logarithms 1 and 0
    assert e.value == pytest.approx(math.exp(0.5))
    assert e.error == pytest.approx(0.5)
    assert e.high == pytest.approx(math.exp(0.5 + 12.7062047 * 0.5), rel=1e-6)


def test_fit_line_exact():
    assert st.fit_line([0, 1, 2, 5], [1, -1, -3, -9]) == pytest.approx((1, -2, 0), abs=1e-12)


def test_fit_line_standard_error_is_the_spread_of_slopes():
    rng = np.random.default_rng(11)
    x = np.array([0.0, 1, 2, 3, 4, 5])
    fits = np.array([st.fit_line(x, 3 - 0.5 * x + rng.normal(0, 0.2, 6))[1:] for _ in range(4000)])
    truth = 0.2 / math.sqrt(((x - x.mean()) ** 2).sum())
    assert abs(fits[:, 0].mean() + 0.5) < 4 * truth / math.sqrt(4000)
    # The variance of 4000 normal values has relative standard deviation sqrt(2 / 4000) = 2.2 %.
    assert abs(fits[:, 0].var() / truth**2 - 1) < 4 * math.sqrt(2 / 4000)
    # se^2 is unbiased; with 4 degrees of freedom its relative standard deviation is sqrt(2/4).
    assert abs((fits[:, 1] ** 2).mean() / truth**2 - 1) < 4 * math.sqrt(0.5 / 4000)


def test_fit_line_refuses_a_single_place():
    with pytest.raises(ValueError):
        st.fit_line([1, 1, 1], [1, 2, 3])


def test_slope_of_exact_convergence():
    n = np.array([1, 4, 16, 64])
    e = st.convergence_slope([(n, 3 / np.sqrt(n)), (2 * n, 5 / np.sqrt(n))])
    assert e.value == pytest.approx(-0.5, abs=1e-12) and e.error == pytest.approx(0, abs=1e-12)


def test_slope_leaves_out_zero_and_unknown_errors():
    e = st.convergence_slope([([1, 4, 16, 64], [1, 0.5, 0, math.nan])])
    assert e.value == pytest.approx(-0.5)
    assert st.convergence_slope([([1, 4], [1, 0])]) is None


def test_slope_interval_is_honest_for_cumulative_checkpoints():
    """Errors of a running mean over shared samples, as an experiment's: the interval must cover -1/2 about 95 % of the time."""
    rng = np.random.default_rng(5)
    checkpoints = np.array([4, 8, 16, 32, 64, 128, 256])
    trials, seeds, pixels = 600, 5, 40
    covered = 0
    for _ in range(trials):
        sums = rng.normal(size=(seeds, checkpoints[-1], pixels)).cumsum(axis=1)[:, checkpoints - 1]
        rmse = np.sqrt(((sums / checkpoints[:, None]) ** 2).mean(axis=2))
        e = st.convergence_slope([(checkpoints, r) for r in rmse])
        covered += e.low <= -0.5 <= e.high
    assert abs(covered / trials - 0.95) < 4 * math.sqrt(0.95 * 0.05 / trials)


def test_two_sided_p_is_uniform_without_an_effect():
    rng = np.random.default_rng(19)
    p = np.array([st.two_sided_p(e.value, e.error, -0.5, 4) for e in (st.mean_estimate(rng.normal(-0.5, 0.1, 4)) for _ in range(3000))])
    for level in (0.01, 0.1, 0.5):
        assert abs((p < level).mean() - level) < 4 * math.sqrt(level * (1 - level) / 3000)
    assert math.isnan(st.two_sided_p(1.0, math.nan, 0, 1))
    assert st.two_sided_p(-0.5, 0.0, -0.5, 4) == 1 and st.two_sided_p(-0.4, 0.0, -0.5, 4) == 0


@pytest.mark.parametrize(("level", "degrees"), [(0.05, 2), (1e-3, 5), (0.01, math.inf)])
def test_a_detectable_departure_is_found_as_often_as_said(level, degrees):
    rng, count = np.random.default_rng(5), 20000
    error = np.sqrt(rng.chisquare(degrees, count) / degrees) if math.isfinite(degrees) else np.ones(count)
    found = (np.abs(rng.normal(size=count) + st.detectable(level, degrees)) > student.isf(level / 2, degrees) * error).mean()
    assert found == pytest.approx(st.POWER, abs=0.01)  # a standard deviation of 0.002
