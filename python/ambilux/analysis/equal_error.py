"""Time to equal error: how many times sooner one run's mean error reaches the level that another one's reaches."""

import math
from dataclasses import dataclass

import numpy as np

FAR = 4.0  # a time that lies further outside of what was measured is no number


def clean(budgets, errors):
    """Points that a logarithmic axis can show, by rising budget. Returns two arrays."""
    x, y = np.asarray(budgets, dtype=float), np.asarray(errors, dtype=float)
    ok = np.isfinite(x) & np.isfinite(y) & (x > 0) & (y > 0)
    order = np.argsort(x[ok], kind="stable")
    return x[ok][order], y[ok][order]


def budget_at_error(budgets, errors, target):
    """Budget (seconds, or samples) from which on a run's error stays at or below `target`, and the factor by which that was extrapolated.

    Between two checkpoints: the line through them in log-log axes, at the last crossing, so that a lucky dip does not count. Outside:
    along the slope -1/2 of independent samples (error^2 ~ 1/n, e.g. Veach 1997, section 2.4) from the nearest end, t = t_end (e_end / target)^2.
    The factor is max(t / t_end, t_end / t) then, and 1 inside. Returns (NaN, NaN) without a point.
    """
    x, y = clean(budgets, errors)
    if len(x) == 0 or not target > 0:
        return math.nan, math.nan
    above = np.flatnonzero(y > target)
    if len(above) == 0 or above[-1] == len(x) - 1:
        end = 0 if len(above) == 0 else -1
        ratio = float(y[end] / target) ** 2
        return float(x[end]) * ratio, max(ratio, 1 / ratio)
    i = above[-1]
    share = math.log(y[i] / target) / math.log(y[i] / y[i + 1])
    return float(x[i]) * float(x[i + 1] / x[i]) ** share, 1.0


@dataclass(frozen=True)
class Speedup:
    """Times `base` / times `run` to the error `target`: > 1 means that the run is faster. sign: "" for a number, ">" or "<" for a bound, since a time
    lies outside of what was measured by more than FAR. doubt: why an error behind it has no interval (heavy_tails.py)."""

    value: float
    sign: str
    target: float
    extrapolated: float
    doubt: str = ""


def speedup(base, run):
    """Speed-up of `run` over `base` at equal error, from curves (budgets, RMSE) of mean errors. None without points.

    The target is the greater of both last errors, so that both have reached it. One that was below it at its first checkpoint already may have been so for
    long: by more than a factor of FAR nothing is claimed, and the ratio with its first checkpoint is a bound.
    """
    (base_x, base_y), (run_x, run_y) = clean(*base), clean(*run)
    if not len(base_x) or not len(run_x):
        return None
    target = max(float(base_y[-1]), float(run_y[-1]))
    (base_time, base_factor), (run_time, run_factor) = budget_at_error(base_x, base_y, target), budget_at_error(run_x, run_y, target)
    if run_factor > FAR:
        return Speedup(base_time / float(run_x[0]), ">", target, run_factor)
    if base_factor > FAR:
        return Speedup(float(base_x[0]) / run_time, "<", target, base_factor)
    return Speedup(base_time / run_time, "", target, max(base_factor, run_factor))
