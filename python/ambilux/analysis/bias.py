"""Does a run converge to the reference's mean? The reference's own noise is part of the answer."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from ambilux.analysis.statistics import Estimate


# Variance of an image's mean over what its pixels tell, if light subpaths reach several pixels each: 1.3^2 on veach-mis (docs/lab/2026-11-25-coverage.md).
DEPENDENT = 1.7


def reference_mean_error(noise, pixels):
    """Upper bound of the standard error of a reference's mean over pixels and channels, from its recorded RMS standard error.

    Pixels are independent, the channels of one are not, so that their errors may add up: the error of a pixel's channel mean is at most the
    mean over channels of se, and se(mean) = sqrt(sum_pixels (mean_channels se)^2) / pixels <= sqrt(mean se^2) / sqrt(pixels) (Cauchy-Schwarz).
    """
    return noise / math.sqrt(pixels)


@dataclass(frozen=True)
class BiasTest:
    estimate: Estimate      # of mean(image) - mean(truth), in units of radiance
    degrees: float          # of freedom
    p: float                # chance of a difference as large if there is none


def bias_test(differences, reference_error, scores=(), confidence=0.95):
    """Test of "the mean over seeds of mean(x_i) - mean(r) is zero", for one difference per seed. None with less than two seeds.

    scores: for each seed its difference in standard errors as its pixels tell them (bias_z), where they are known.

    All differences hold the same error of r, which averaging over seeds cannot reduce:
        B = mean d_i,  se^2 = s^2 / n + se_r^2,  t = B / se
    with s^2 the variance of the d_i. B / se is close to Student's t with the degrees of freedom of Satterthwaite (1946, Biometrics
    Bulletin 2(6)): nu = se^4 / ((s^2/n)^2 / (n-1)), se_r counting as known. Without the term se_r^2 every run would be found biased in the end.

    Two or three seeds often agree by chance far better than their noise allows; then s is small, nu large, and 3 % of such tests would be past the level 0.0003. The pixels of the
    images tell their noise too, (d_i / z_i)^2 - se_r^2, with so many degrees of freedom that it counts as known: the larger of it (mean over seeds, times DEPENDENT) and s^2 is taken.
    z_i is the sum of the pixels' differences over the root of the sum of their squares, a bias included. One that lies in k pixels alone, however large, cannot exceed sqrt(k n) standard errors
    here: of a few pixels the errors tell, not the mean.
    """
    d = np.asarray(differences, dtype=float)
    n = len(d)
    if n < 2 or not np.isfinite(d).all():
        return None
    mean, own, unsure = float(d.mean()), float(d.var(ddof=1)) / n, n - 1
    told = [DEPENDENT * ((x / z) ** 2 - reference_error**2) for x, z in zip(d, scores) if z and math.isfinite(z) and math.isfinite(reference_error)]
    if told and np.mean(told) / n > own:
        own, unsure = float(np.mean(told)) / n, math.inf
    total = own + (reference_error**2 if math.isfinite(reference_error) else 0.0)
    error = math.sqrt(total)
    if error == 0:
        return BiasTest(Estimate(mean, 0.0, mean, mean), math.inf, 1.0 if mean == 0 else 0.0)
    degrees = total**2 / (own**2 / unsure) if own > 0 and unsure < math.inf else math.inf
    half = float(student.ppf(0.5 + confidence / 2, degrees)) * error
    return BiasTest(Estimate(mean, error, mean - half, mean + half), degrees, float(2 * student.sf(abs(mean) / error, degrees)))
