"""Speed-up at equal error: how many times sooner one run reaches the error that another one reaches."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.statistics import Estimate, ratio_of_pairs


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
    """Times `base` / times `run` to the error `target`: > 1 means that the run is faster."""

    estimate: Estimate
    target: float
    extrapolated: float  # greatest factor by which a seed's time lies outside of what was measured; 1: all lie inside
    pairs: int


def speedup(base, run, confidence=0.95):
    """Speed-up of `run` over `base` at equal error, from {seed: (budgets, errors)} of each. None without a common seed.

    target e* = the greatest last error of all seeds of both, so that each of them has reached it. With T(e*) of budget_at_error for each
    seed, ratio_of_pairs(T_base, T_run): the geometric mean of the ratios, with Student's interval on their logarithms.
    """
    last = {s: tuple(clean(*series[s])[1][-1:] for series in (base, run)) for s in base.keys() & run.keys()}
    seeds = sorted(s for s, (a, b) in last.items() if len(a) and len(b))
    if not seeds:
        return None
    target = max(float(e[0]) for s in seeds for e in last[s])
    times = [[budget_at_error(*series[s], target) for s in seeds] for series in (base, run)]
    ratio = ratio_of_pairs(*[[t for t, _ in of_run] for of_run in times], confidence)
    return Speedup(ratio, target, max(factor for of_run in times for _, factor in of_run), len(seeds))
