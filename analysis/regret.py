"""python -m analysis.regret FOLDER [--run auto]: what a run that selects from others loses beside the best of them.

The regret on a scene is the run's product of error and time over the least product of the others: 1 is the best fixed choice, which nobody knows before. Of the others the least is
taken of what was measured, so that noise alone brings regrets above 1. The time of a selection counts.
"""

import argparse
import math
import sys
from collections import namedtuple
from pathlib import Path

from analysis import efficiency
from analysis import experiment as experiments

Regret = namedtuple("Regret", "scene selected best untrimmed trimmed")  # untrimmed: heavy_tails.Judged; trimmed: a number


def product(rows, error):
    """Mean error times mean time over the seeds of a run; infinite without positive errors, which are below the reference's noise."""
    errors = [getattr(r, error) for r in rows]
    value = sum(errors) * sum(r.time for r in rows) / len(rows) ** 2 if rows else math.nan
    return value if math.isfinite(value) and value > 0 else math.inf


def of_scene(data, scene, run):
    """Regret of `run` on a scene; None where it, or all others, has no rows."""
    last = {r: data.select(scene, r, data.last_common_checkpoint(scene)) for r in data.runs}
    others = [r for r in data.runs if r != run and last[r]]
    if not last[run] or not others:
        return None
    best, trimmed = (min(others, key=lambda r, e=e: product(last[r], e)) for e in ("relative_error", "trimmed_error"))

    def work(r, over_batches):
        return efficiency.of_batches(data, scene, r, data.metric, last[r]) if over_batches else efficiency.of_seeds(last[r], data.metric)

    def ratio(over_batches):
        base, own = work(best, over_batches), work(run, over_batches)
        return efficiency.ratio(base, own, run) if base and own else None

    selected = ", ".join(f"{method} ({len(seeds)})" for method, seeds in data.methods(scene, run).items())
    return Regret(scene, selected, best, efficiency.lead(ratio(True), ratio(False)), product(last[run], "trimmed_error") / product(last[trimmed], "trimmed_error"))


def geometric_mean(values):
    good = [v for v in values if math.isfinite(v) and v > 0]
    return math.exp(sum(map(math.log, good)) / len(good)) if good else math.nan


def interval(j):
    return f"{j.low:.2f} to {j.high:.2f}" if j.trusted else j.doubt or "unknown"


def markdown(data, run):
    """Lines of the table."""
    regrets = [r for scene in data.scenes if (r := of_scene(data, scene, run))]
    lines = ["| scene | selected (seeds) | best fixed | regret | 95 % | trimmed |", "| --- | --- | --- | --- | --- | --- |"]
    lines += [f"| {r.scene} | {r.selected} | {r.best} | {r.untrimmed.value:.2f} | {interval(r.untrimmed)} | {r.trimmed:.2f} |" for r in regrets]
    means = [geometric_mean(values) for values in ([r.untrimmed.value for r in regrets], [r.trimmed for r in regrets])]
    return [*lines, f"| geometric mean of {len(regrets)} | | | {means[0]:.3f} | | {means[1]:.3f} |"]


def main():
    parser = argparse.ArgumentParser(prog="python -m analysis.regret", description="What a run that selects from others loses beside the best of them.")
    parser.add_argument("results", type=Path, help="folder of an experiment")
    parser.add_argument("--run", default="auto", help="the run that selects (default: auto)")
    options = parser.parse_args()
    try:
        data = experiments.load(options.results)
        if options.run not in data.runs:
            raise experiments.InputError(f"--run {options.run}: there is no such run; there are {', '.join(data.runs)}")
    except experiments.InputError as e:
        print(f"error: {e}", file=sys.stderr)
        return 3
    print("\n".join(markdown(data, options.run)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
