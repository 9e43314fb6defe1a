"""Statistics over seeds and over checkpoints. Pure functions on numbers; each names its formula and source.

Further ones, one question per file: equal_error.py (speed-up), bias.py, strategy_variance.py.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, norm
from scipy.stats import t as student

POWER = 0.9  # chance with which a test finds a departure that it is said to find


@dataclass(frozen=True)
class Estimate:
    """A value, its standard error (NaN if one sample gives none) and the ends of its 95 % confidence interval."""

    value: float
    error: float
    low: float
    high: float


def mean_estimate(values, confidence=0.95):
    """Mean of independent values: m, s/sqrt(n), m +- t(n-1) s/sqrt(n) (Student 1908). One value gives an unknown (NaN) error."""
    values = np.asarray(values, dtype=float)
    n = len(values)
    if n == 0:
        raise ValueError("mean_estimate: no values")
    mean = float(values.mean())
    if n == 1:
        return Estimate(mean, math.nan, math.nan, math.nan)
    error = float(values.std(ddof=1)) / math.sqrt(n)
    half = float(student.ppf(0.5 + confidence / 2, n - 1)) * error
    return Estimate(mean, error, mean - half, mean + half)


def ratio_of_pairs(a, b, confidence=0.95):
    """Geometric mean of a_i / b_i with its confidence interval, for positive pairs (same seed).

    d_i = log(a_i / b_i); exp(mean d), and exp of Student's interval of mean d (paired t interval, Student 1908). Pairing is
    right whether or not equal seeds make a and b correlated. `error` is the standard error of the logarithm.
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    if a.shape != b.shape or not ((a > 0).all() and (b > 0).all()):
        raise ValueError("ratio_of_pairs: needs positive pairs")
    d = mean_estimate(np.log(a) - np.log(b), confidence)
    return Estimate(math.exp(d.value), d.error, math.exp(d.low), math.exp(d.high))


def fit_line(x, y):
    """Least squares y = a + b x. Returns (a, b, standard error of b).

    b = Sxy / Sxx, se(b) = sqrt(RSS / (n-2) / Sxx) (Draper and Smith 1998, eqs. 1.2.9 and 1.4.5); NaN for two points. The
    standard error holds for independent errors only.
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    n = len(x)
    sxx = float(((x - x.mean()) ** 2).sum()) if n else 0.0
    if n < 2 or sxx == 0:
        raise ValueError("fit_line: needs two different x")
    b = float(((x - x.mean()) * (y - y.mean())).sum()) / sxx
    a = float(y.mean()) - b * float(x.mean())
    rss = float(((y - a - b * x) ** 2).sum())
    return a, b, math.sqrt(rss / (n - 2) / sxx) if n > 2 else math.nan


def convergence_slope(series):
    """Slope of log(error) against log(budget); -1/2 is what independent samples give.

    `series`: one (budgets, errors) pair per seed. The checkpoints of one seed share samples, so that their errors are
    correlated and the standard error of one joint fit would be too small. Therefore each seed is fitted alone and the
    slopes, which are independent, are averaged (the summary measures of Matthews et al. 1990, BMJ 300:230). With one seed
    the standard error is that of the fit, which is then too small, and there is no interval.
    Values that are not positive and finite are left out. Returns None if no seed has two points.
    """
    slopes, error = [], math.nan
    for budgets, errors in series:
        x, y = np.asarray(budgets, dtype=float), np.asarray(errors, dtype=float)
        ok = np.isfinite(x) & np.isfinite(y) & (x > 0) & (y > 0)
        if len(np.unique(x[ok])) >= 2:
            _, b, error = fit_line(np.log(x[ok]), np.log(y[ok]))
            slopes.append(b)
    if not slopes:
        return None
    if len(slopes) == 1:
        return Estimate(slopes[0], error, math.nan, math.nan)
    return mean_estimate(slopes)


def two_sided_p(value, error, expected, samples):
    """P(|T| >= |value - expected| / error) for Student's T with samples - 1 degrees of freedom: how often chance alone moves a mean of
    `samples` values, of standard error `error`, this far (Student 1908). NaN if the error is unknown; 1 or 0 if it is zero."""
    if samples < 2 or not math.isfinite(error):
        return math.nan
    if error == 0:
        return 1.0 if math.isclose(value, expected, rel_tol=1e-9) else 0.0
    return float(2 * student.sf(abs(value - expected) / error, samples - 1))


def detectable(level, degrees):
    """Departure, in standard errors, that Student's two-sided test at `level` finds with chance POWER.

    It finds a departure d where |d + Z| > t(1 - level/2) sqrt(X / nu), Z normal, X chi-squared with nu degrees of freedom (noncentral t, e.g. Johnson and Kotz 1970, chapter 31). The
    chance is averaged over 2000 quantiles of X, without the tail on the other side."""
    bound = student.isf(level / 2, degrees)
    spread = np.sqrt(chi2.ppf((np.arange(2000) + 0.5) / 2000, degrees) / degrees) if math.isfinite(degrees) else np.ones(1)
    return float(brentq(lambda d: float(norm.sf(bound * spread - d).mean()) - POWER, 0.0, 40.0 * bound + 10.0))
