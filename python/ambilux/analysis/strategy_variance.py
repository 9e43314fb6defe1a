"""How much variance each strategy (s,t) of a bidirectional estimator contributes, from images of independent seeds."""

import math

import numpy as np
from scipy.stats import t as student

from ambilux.analysis.statistics import Estimate


def variance_of_one_sample(images, spp):
    """Variance of one sample per pixel, mean over pixels and channels, from n >= 2 independent images, shape (n, ...). spp: samples of each, or one number for all.

    V = mean_pixels( sum_i w_i (x_i - m)^2 / (n-1) ) with w_i = spp_i and m = sum w_i x_i / sum w_i: an image is a mean of spp_i samples, so that its
    variance is V / spp_i, and this is the unbiased estimate from values of known weights (e.g. Cochran 1977, section 10.7). Needs no reference, and holds no bias.
    """
    x = np.asarray(images, dtype=float).reshape(len(images), -1)
    if len(x) < 2:
        raise ValueError("variance_of_one_sample: needs two images")
    w = np.broadcast_to(np.asarray(spp, dtype=float), len(x))[:, None]
    mean = (w * x).sum(axis=0) / w.sum()
    return float((w * (x - mean) ** 2).sum(axis=0).mean() / (len(x) - 1))


def largest_pixel(images, spp):
    """Share of variance_of_one_sample that the greatest pixel holds, its channels together; NaN without variance. Near 1 a single bright sample decides. images: shape (n, height, width, channels)."""
    x = np.asarray(images, dtype=float)
    w = np.broadcast_to(np.asarray(spp, dtype=float), len(x)).reshape(-1, *[1] * (x.ndim - 1))
    of_pixels = (w * (x - (w * x).sum(axis=0) / w.sum()) ** 2).sum(axis=(0, -1))
    return float(of_pixels.max() / of_pixels.sum()) if of_pixels.sum() > 0 else float("nan")


def strategy_variance(images, spp, confidence=0.95):
    """variance_of_one_sample with its standard error and interval.

    Leave-one-out jackknife over seeds (Efron and Stein 1981, Ann. Stat. 9(3)): V_(i) without image i, pseudo-values n V - (n-1) V_(i), their
    mean (which is V itself for equal spp, V being a quadratic statistic) and Student's interval of it. Seeds are independent, pixels may share light paths
    (t = 1 splats), therefore nothing is counted over pixels. Needs three images for an interval; two give the value alone, one gives NaN.
    The variances of strategies do not add up to the variance of their sum: strategies share subpaths within a sample.
    """
    x = np.asarray(images, dtype=float).reshape(len(images), -1)
    n, w = len(x), np.broadcast_to(np.asarray(spp, dtype=float), len(x))
    if n < 2:
        return Estimate(math.nan, math.nan, math.nan, math.nan)
    value = variance_of_one_sample(x, spp)
    if n == 2:
        return Estimate(value, math.nan, math.nan, math.nan)
    pseudo = np.array([n * value - (n - 1) * variance_of_one_sample(np.delete(x, i, axis=0), np.delete(w, i)) for i in range(n)])
    error = float(pseudo.std(ddof=1)) / math.sqrt(n)
    half = float(student.ppf(0.5 + confidence / 2, n - 1)) * error
    return Estimate(value, error, max(0.0, value - half), value + half)
