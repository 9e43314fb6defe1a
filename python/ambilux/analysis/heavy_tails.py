"""Intervals for means of positive values with heavy tails, and when an interval is not to be trusted.

Errors of renders are such values: squared, with rare bright samples. Where the data cannot support an interval, there is none, and `doubt` says why.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import kruskal
from scipy.stats import t as student

RESAMPLES = 4999
FEWEST_BATCHES = 32  # below, resampling covers heavy tails too seldom (tests/coverage.py)
FEWEST_RESAMPLED_SEEDS = 12
FEWEST_SEEDS = 3
LARGEST = 2.5  # largest value over the mean, from which on a few values decide
TRIMMED = 1.25  # relMSE over relMSE without its worst pixels, from which on a few pixels decide
AVERAGING = 1.5  # error of the whole over what independent batches make of it
DIFFERENT = 0.01  # chance at which seeds count as different where it is not known that all ran one method
SAME_METHOD = 1e-4  # the same where they did: then only samples that are not independent make a difference


@dataclass(frozen=True)
class Judged:
    """A positive value with the ends of its 95 % interval. Both are NaN where `doubt`, a few words, says why they are not to be trusted.

    p: chance of a value as far from 1 if it is 1, for ratios; NaN where it is not known. over: the units, "batches" or "seeds", and their number."""

    value: float
    low: float
    high: float
    p: float
    over: str
    units: int
    doubt: str = ""

    @property
    def trusted(self):
        return not self.doubt and math.isfinite(self.low)


def unknown(value, over, units, doubt):
    return Judged(value, math.nan, math.nan, math.nan, over, units, doubt)


def log_product(columns):
    """log of the product of the columns' means, and its standard error, for rows that are independent. `columns`: shape (..., n, k).

    theta = sum_k log mean x_k; the rows' influence is u = sum_k x_k / mean x_k - k; se = s(u) / sqrt(n) (delta method, e.g. Efron and Tibshirani 1993,
    chapter 21)."""
    means = columns.mean(axis=-2, keepdims=True)
    influence = (columns / means).sum(axis=-1)
    return np.log(means).sum(axis=(-1, -2)), influence.std(axis=-1, ddof=1) / math.sqrt(columns.shape[-2])


def resampled(signed, resamples, seed):
    """Studentised differences (theta* - theta) / se* of samples drawn from the rows, with replacement, apart for each of `signed`: [(sign, rows)]."""
    rng = np.random.default_rng(seed)
    total, variance = np.zeros(resamples), np.zeros(resamples)
    for sign, rows in signed:
        theta, _ = log_product(rows)
        for begin in range(0, resamples, 1000):
            end = min(resamples, begin + 1000)
            own, error = log_product(rows[rng.integers(0, len(rows), (end - begin, len(rows)))])
            total[begin:end] += sign * (own - theta)
            variance[begin:end] += error**2
    good = variance > 0
    return total[good] / np.sqrt(variance[good])


@dataclass(frozen=True)
class Factor:
    """The logarithm of a factor that few independent units tell, its standard error and degrees of freedom (Student's)."""

    log: float
    error: float
    degrees: float

    def half(self, chance):
        """Half the width of the interval that misses with this chance."""
        return float(student.isf(chance / 2, self.degrees)) * self.error if self.error > 0 else 0.0


def chance_beyond(distance, factors):
    """Chance at which the interval of the sum of independent factors ends `distance` from it, 1e-12 at least; of one factor it is Student's p."""
    if len(factors) == 1:
        return float(2 * student.sf(distance / factors[0].error, factors[0].degrees))

    def excess(logarithm):
        return math.sqrt(sum(f.half(math.exp(logarithm)) ** 2 for f in factors)) - distance
    least = math.log(1e-12)
    return 1.0 if excess(0.0) >= 0 else 1e-12 if excess(least) <= 0 else math.exp(brentq(excess, least, 0.0, xtol=1e-6))


def estimate(signed, over, doubt="", by_bootstrap=True, level=0.95, seed=1, besides=()):
    """Judged of exp(sum of sign * log_product(rows)) times the factors `besides`. `signed`: [(sign, rows)], rows of shape (n, k), positive.

    by_bootstrap: the bootstrap-t interval on the logarithm (Efron 1979; Hall 1988, Ann. Stat. 16(3), on why the studentised one follows skewed
    data), else Student's with the degrees of freedom of Welch and Satterthwaite. Intervals of independent factors are put together by the squares of their half widths, on
    either side of the sum (MOVER: Zou and Donner 2008, Stat. Med. 27(10)). p is that of such an interval from Student's alone: its tail needs no resamples.
    """
    signed = [(sign, np.asarray(rows, dtype=float).reshape(len(rows), -1)) for sign, rows in signed]
    units = min(len(rows) for _, rows in signed)
    parts = [(sign, *log_product(rows), len(rows)) for sign, rows in signed if len(rows) > 1]
    theta = sum(sign * float(log_product(rows)[0]) for sign, rows in signed) if units > 1 else sum(
        sign * float(np.log(rows.mean(axis=0)).sum()) for sign, rows in signed)
    theta += sum(f.log for f in besides)
    value = math.exp(theta)
    if doubt or units < 2:
        return unknown(value, over, units, doubt or f"{units} of {over}")
    of_rows = float(sum(error**2 for _, _, error, _ in parts))
    error = math.sqrt(of_rows + sum(f.error**2 for f in besides))
    if error == 0:
        return Judged(value, value, value, 1.0 if math.isclose(value, 1, rel_tol=1e-9) else 0.0, over, units)
    own = [Factor(0.0, math.sqrt(of_rows), of_rows**2 / sum(float(e) ** 4 / (n - 1) for _, _, e, n in parts))] if of_rows > 0 else []
    p = chance_beyond(abs(theta), [f for f in (*own, *besides) if f.error > 0])
    ends = [f.half(1 - level) for f in own for _ in range(2)] or [0.0, 0.0]
    if own and by_bootstrap:
        low, high = np.quantile(resampled(signed, RESAMPLES, seed), [(1 - level) / 2, (1 + level) / 2])
        ends = [max(0.0, end) * math.sqrt(of_rows) for end in (high, -low)]
    few = sum(f.half(1 - level) ** 2 for f in besides)
    below, above = (math.sqrt(end**2 + few) for end in ends)
    return Judged(value, math.exp(theta - below), math.exp(theta + above), p, over, units)


def doubt_of_batches(groups, whole=(), different=DIFFERENT):
    """Why an interval over batches of passes is not to be trusted; "" if nothing speaks against it.

    groups: for each seed its batches' values, each an estimate of one and the same variance of a sample; whole: for each seed what the image of all its batches
    makes of it. Three things are asked of the data. (1) No value is LARGEST times the mean or more: a tail whose far end was met
    once or twice has more beyond. (2) Batches average out: the whole's value is about that of the batches, mean whole / mean batches = 1 for
    independent ones, and their number where all have the same error, such as light that none has found. (3) Seeds agree (Kruskal and Wallis 1952; `different`: the chance below which they do not).
    """
    values = np.concatenate([np.asarray(g, dtype=float) for g in groups]) if groups else np.array([])
    if len(values) < FEWEST_BATCHES:
        return f"{len(values)} batches" if len(values) else "no batches"
    if not np.isfinite(values).all() or not values.mean() > 0:
        return "errors below the reference's noise"
    if values.max() >= LARGEST * values.mean():
        return "few samples decide"
    ratio = averaging(groups, whole)
    if ratio >= AVERAGING:
        return f"batches do not average out (factor {ratio:.1f})"
    if len(groups) > 1 and min(map(len, groups)) > 1 and np.ptp(values) > 0 and kruskal(*groups).pvalue < different:
        return "seeds differ"
    return ""


def averaging(groups, whole):
    """Mean of `whole` over the mean of all batches: 1 for independent batches; NaN if unknown."""
    values = [v for g in groups for v in g]
    return float(np.mean(whole) / np.mean(values)) if len(whole) and values and np.mean(values) > 0 else math.nan


def doubt_of_seeds(values, few_pixels=()):
    """Likewise of an interval over seeds. few_pixels: for each seed relMSE over relMSE without its worst pixels, where it was recorded. An error over
    many pixels, none of which decides, is close to normal, and then three seeds do; else only many seeds can show the tail."""
    values = np.asarray(values, dtype=float)
    if len(values) < FEWEST_SEEDS:
        return f"{len(values)} seed{'s' if len(values) != 1 else ''}"
    if not np.isfinite(values).all() or not values.mean() > 0:
        return "errors below the reference's noise"
    if len(values) >= FEWEST_RESAMPLED_SEEDS:
        return "few samples decide" if values.max() >= LARGEST * values.mean() else ""
    known = [f for f in few_pixels if math.isfinite(f)]
    if not known:
        return f"{len(values)} seeds"
    return "few pixels decide" if max(known) >= TRIMMED else ""
