"""Intervals for heavy tails: they cover what they say, or are refused with a reason. All cases, with figures: python -m ambilux.analysis.tests.coverage."""

import math

import numpy as np
import pytest

from ambilux.analysis import efficiency, heavy_tails
from ambilux.analysis.tests import coverage

TRIALS = 120


def case(name):
    return next(c for c in coverage.CASES if c[0] == name)


@pytest.mark.parametrize("name", ["normal", "normal, 2 seeds", "log-normal 1", "splats on 8 pixels", "seeds: normal, 3"])
def test_stated_intervals_cover(name):
    stated, covers, _ = coverage.simulate(case(name), TRIALS, seed=3)
    assert stated > 0.85
    # Binomial: 0.95 of the stated ones, four standard deviations below; 0.93 is what bootstrap-t reaches for skewed data.
    assert covers > 0.93 - 4 * math.sqrt(0.93 * 0.07 / (stated * TRIALS))


@pytest.mark.parametrize("name", ["log-normal 2", "1 in 1e5, 0.2 met", "1 in 1e5, 2 met", "1 in 1e5, 30 met", "seeds: 1 in 1e5, 3", "seeds: log-normal 1.5, 4"])
def test_where_few_samples_decide_nothing_wrong_is_stated(name):
    stated, _, wrong = coverage.simulate(case(name), TRIALS, seed=4)
    assert stated < 0.25
    assert wrong < 0.07 + 4 * math.sqrt(0.07 * 0.93 / TRIALS)


def test_reasons_are_named():
    rng = np.random.default_rng(6)
    steady = [list(rng.uniform(0.9, 1.1, 16)) for _ in range(3)]
    assert heavy_tails.doubt_of_batches(steady, [1.0, 1.0, 1.0]) == ""
    assert heavy_tails.doubt_of_batches([steady[0]], [1.0]) == "16 batches"
    assert heavy_tails.doubt_of_batches([[*steady[0][:-1], 4.0], *steady[1:]], [1.0] * 3) == "few samples decide"
    assert heavy_tails.doubt_of_batches(steady, [16.0] * 3) == "batches do not average out (factor 16.0)"
    assert heavy_tails.doubt_of_batches([[2 * x for x in steady[0]], *steady[1:]], [2.0, 1.0, 1.0]) == "seeds differ"
    assert heavy_tails.doubt_of_batches([], []) == "no batches"
    assert heavy_tails.doubt_of_seeds([1.0]) == "1 seed" and heavy_tails.doubt_of_seeds([1.0, 1.1]) == "2 seeds"
    assert heavy_tails.doubt_of_seeds([1.0, 1.1, 0.9]) == "3 seeds"  # nobody recorded whether few pixels decide
    assert heavy_tails.doubt_of_seeds([1.0, 1.1, 0.9], [1.05, 1.02, 1.01]) == ""
    assert heavy_tails.doubt_of_seeds([1.0, 1.1, 0.9], [1.05, 1.9, 1.01]) == "few pixels decide"
    assert heavy_tails.doubt_of_seeds([0.0, 0.0, 0.0], [1.0] * 3) == "errors below the reference's noise"


def test_a_product_of_means_by_hand():
    rows = np.array([[1.0, 4.0], [3.0, 4.0]])
    theta, error = heavy_tails.log_product(rows)
    assert theta == pytest.approx(math.log(8))
    assert error == pytest.approx(np.std([0.5, 1.5], ddof=1) / math.sqrt(2))
    found = heavy_tails.estimate([(-1, rows)], "seeds", by_bootstrap=False)
    assert found.value == pytest.approx(1 / 8) and found.high == pytest.approx(math.exp(12.7062047 * error) / 8, rel=1e-6)


def test_ratio_of_two_runs_covers_the_truth():
    """Two methods whose errors differ by 2: gamma batches, as of ten noisy pixels."""
    rng, trials = np.random.default_rng(9), 300
    covered = tests = 0
    for _ in range(trials):
        a, b = rng.gamma(8, 1 / 8, (48, 1)), 2 * rng.gamma(8, 1 / 8, (48, 1))
        found = heavy_tails.estimate([(-1, a), (1, b)], "batches")
        covered += found.low <= 2 <= found.high
        tests += heavy_tails.estimate([(-1, a), (1, b / 2)], "batches", by_bootstrap=False).p < 0.05
    assert abs(covered / trials - 0.95) < 4 * math.sqrt(0.95 * 0.05 / trials)
    assert abs(tests / trials - 0.05) < 4 * math.sqrt(0.95 * 0.05 / trials)


def test_the_same_data_give_the_same_interval():
    rows = np.random.default_rng(2).gamma(8, 1 / 8, (40, 2))
    assert heavy_tails.estimate([(1, rows)], "batches") == heavy_tails.estimate([(1, rows)], "batches")


@pytest.mark.parametrize("seeds, spread", [(3, 0.0), (3, 0.1), (2, 0.05)])
def test_times_that_vary_between_renders_are_in_the_interval(seeds, spread):
    """A busy machine slows whole renders down, with all of their batches: of 48 batches with 3 seeds, times are known from 3."""
    trials = 100
    covered, tests = coverage.simulate_times(seeds, spread, trials)
    assert covered > 0.95 - 4 * math.sqrt(0.95 * 0.05 / trials)
    assert tests < 0.05 + 4 * math.sqrt(0.95 * 0.05 / trials)


def test_seeds_that_are_slow_together_are_pairs():
    """The same seed was busy by 1.6 for both runs: their ratio does not see it, the efficiency of one does."""
    rng = np.random.default_rng(13)
    a, b = (coverage.work(rng, 1.0, 1.0, 3, 0.0) for _ in range(2))
    busy = {1: 1.0, 2: 1.6, 3: 1.1}
    slow = [efficiency.Work(w.rows, w.over, "", busy) for w in (a, b)]
    assert efficiency.ratio(*slow, "b") == efficiency.ratio(a, b, "b")
    one = efficiency.efficiency(slow[0])
    assert one.high / one.low > 2 and one.value == pytest.approx(efficiency.efficiency(a).value / np.mean(list(busy.values())))
    alone = efficiency.Work(a.rows, a.over, "", {1: 1.0})
    assert efficiency.efficiency(alone).doubt == "1 seed"


def test_of_two_values_that_nothing_supports_that_of_the_whole_image_is_shown():
    """Batches that each miss the same light look better than their image is."""
    batches, seeds = (heavy_tails.unknown(value, over, 3, doubt) for value, over, doubt in ((34.4, "batches", "batches do not average out (factor 3.6)"), (9.9, "seeds", "2 seeds")))
    shown = efficiency.lead(batches, seeds)
    assert (shown.value, shown.doubt) == (9.9, "batches do not average out (factor 3.6)")
    assert efficiency.lead(None, seeds) is seeds and efficiency.lead(batches, None) is batches
