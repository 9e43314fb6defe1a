"""What the data say in words. One level for all statements of a table together, whatever they are about."""

import math
from functools import lru_cache
from statistics import NormalDist

from ambilux.analysis import efficiency, statistics, summary

LEVEL = 0.01  # chance of a false statement among all of a table
WEAK = 0.25  # half of the way from slope -1/2 to an error that does not fall: a test that cannot find this much is not one


def family(lines):
    """Number of statements that a table of these lines can make: a slope, a bias of the mean and of each seed, a ratio for each line, and which of a
    scene's runs is best. Each is made at LEVEL over their number (Bonferroni), which holds however they depend on each other."""
    of_scene = {}
    for line in lines:
        of_scene[line.scene] = of_scene.get(line.scene, 0) + 1
    return max(1, sum(3 + line.seeds for line in lines) + sum(n * (n - 1) // 2 for n in of_scene.values()))


def limit(lines):
    """Chance below which a statement is made."""
    return LEVEL / family(lines)


def bias_threshold(tests, level=LEVEL):
    """|z| that exceeds chance at `level` over all tests together: two-sided normal quantile at level / tests (Bonferroni), which
    holds although tests against one reference are dependent."""
    return NormalDist().inv_cdf(1 - level / tests / 2)


def is_biased(line, lines):
    """Whether the means of single seeds or the mean over seeds differ from the reference's by more than chance."""
    return line.bias_z > bias_threshold(family(lines)) or (line.bias is not None and line.bias.p < limit(lines))


def biased(lines):
    """{(scene, run)} of those."""
    return {(line.scene, line.run) for line in lines if is_biased(line, lines)}


def slope_p(line):
    """Chance of a slope as far from -1/2; NaN with less than two seeds."""
    return math.nan if line.slope is None else statistics.two_sided_p(line.slope.value, line.slope.error, summary.SLOPES["rmse"], line.slope_seeds)


@lru_cache
def standard_errors(level, degrees):
    """statistics.detectable for one standard error."""
    return statistics.detectable(level, degrees)


def slope_power(line, lines):
    """Departure of the slope from -1/2, up or down, that its test would have found (statistics.POWER)."""
    return line.slope.error * standard_errors(limit(lines), line.slope_seeds - 1)


def bias_power(line, lines):
    """The same of the mean from the reference's."""
    return line.bias.estimate.error * standard_errors(limit(lines), line.bias.degrees)


def differs(line, lines):
    """Whether a run's efficiency differs from the base run's by more than chance."""
    return line.ratio is not None and line.ratio.trusted and line.ratio.p < limit(lines)


def best(lines, scene):
    """The line of a scene whose efficiency is above every other one's by more than chance; None without one."""
    rows = [line for line in lines if line.scene == scene and math.isfinite(line.efficiency.value)]
    if len(rows) < 2:
        return None
    first = max(rows, key=lambda line: line.efficiency.value)
    for other in rows:
        if other is first:
            continue
        found = efficiency.lead(*summary.ratios((first.work_batches, first.work_seeds), (other.work_batches, other.work_seeds), other.run, for_test=True))
        if found is None or not found.trusted or not (found.value > 1 and found.p < limit(lines)):
            return None
    return first


def slope_said(line, lines):
    p = slope_p(line)
    if math.isnan(p):
        return "slope: not tested (needs two seeds and two checkpoints above the noise of the reference)"
    found = f"slope {line.slope.value:.3f} [{line.slope.low:.3f}, {line.slope.high:.3f}]"
    if p < limit(lines):
        return f"{found}: differs from −1/2 by more than chance"
    power = slope_power(line, lines)
    if power > WEAK:
        return f"{found}: {line.slope_seeds} seeds cannot test it (they would show a departure from −1/2 by {power:.2g} or more)"
    return f"{found}: no departure from −1/2 found{beside(p, line.slope_seeds)}; one by {power:.2g} would have been"


def bias_said(line, lines):
    if line.bias is None:
        return "bias over seeds: not tested (needs two seeds)"
    e = line.bias.estimate
    known = "" if math.isfinite(line.reference_error) else " (the noise of the reference is unknown and counts as none)"
    found = f"mean off by {e.value:+.2e} [{e.low:+.1e}, {e.high:+.1e}]"
    if line.bias.p < limit(lines):
        return f"{found}: more than chance and the noise of the reference explain{known}"
    return f"{found}: no bias found{beside(line.bias.p, line.seeds)}; one of {bias_power(line, lines):.1e} would have been{known}"


def beside(p, seeds):
    """What an interval says that a test at the level of all statements does not."""
    return f" at the level of all statements, though the 95 % interval of {seeds} seeds excludes it" if p < 0.05 else ""


def verdicts(lines):
    """What the data say on slope and bias, in whole sentences, for (scene, run)."""
    return {(line.scene, line.run): (slope_said(line, lines), bias_said(line, lines) + (f"; by its method {line.stated_bias}" if line.stated_bias else "")) for line in lines}
