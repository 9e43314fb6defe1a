"""What the data say in words. One level for all statements of a table together, whatever they are about."""

import math
from statistics import NormalDist

from ambilux.analysis import efficiency, statistics, summary

LEVEL = 0.01  # chance of a false statement among all of a table


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


def told(p, limit, seeds, found, none):
    """What a test says: found; found by itself, but not at the level of the whole table; or nothing found."""
    return found if p < limit else f"{none} at the level of the whole table, though the interval excludes it ({seeds} seeds)" if p < 0.05 else none


def verdicts(lines):
    """What the data say on slope and bias, in whole sentences, for (scene, run)."""
    out = {}
    for line in lines:
        p = slope_p(line)
        if math.isnan(p):
            slope_said = "slope: not tested (needs two seeds and two checkpoints above the noise of the reference)"
        else:
            slope_said = (f"slope {line.slope.value:.3f} [{line.slope.low:.3f}, {line.slope.high:.3f}]: "
                          + told(p, limit(lines), line.slope_seeds, "differs from −1/2 by more than chance", "no departure from −1/2 found"))
        if line.bias is None:
            bias_said = "bias over seeds: not tested (needs two seeds)"
        else:
            e = line.bias.estimate
            known = "" if math.isfinite(line.reference_error) else " (the noise of the reference is unknown and counts as none)"
            bias_said = (f"mean off by {e.value:+.2e} [{e.low:+.1e}, {e.high:+.1e}]: "
                         + told(line.bias.p, limit(lines), line.seeds, "more than chance and the noise of the reference explain", "no bias found") + known)
        out[line.scene, line.run] = (slope_said, f"{bias_said}; by its method {line.stated_bias}" if line.stated_bias else bias_said)
    return out
