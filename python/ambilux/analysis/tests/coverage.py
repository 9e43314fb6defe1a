"""How often do the intervals of heavy_tails.py cover the truth? python -m ambilux.analysis.tests.coverage [TRIALS]

Renders are simulated pixel by pixel: independent passes of normal, log-normal and outlier samples, and light subpaths that reach several pixels.
Printed for each case: the share of tables in which an interval is stated, how often a stated one covers, and the share of all in which it is stated and wrong; then the
same of ratios of runs whose renders take more or less time each.
"""

import sys

import numpy as np

from ambilux.analysis import efficiency, heavy_tails

BATCHES = 16


def normal(rng, shape, samples):
    return rng.normal(size=shape) / np.sqrt(samples), 1.0


def log_normal(sigma):
    def draw(rng, shape, samples):
        mean = np.exp(sigma**2 / 2)
        return np.mean([rng.lognormal(0, sigma, size=shape) for _ in range(samples)], axis=0) - mean, (np.exp(sigma**2) - 1) * mean**2
    return draw


def outliers(rate):
    """Normal noise of deviation 0.3, and with the chance `rate` a value that holds as much light as all others."""
    def draw(rng, shape, samples):
        found = rng.binomial(samples, rate, size=shape) / (rate * samples)
        return 0.3 * rng.normal(size=shape) / np.sqrt(samples) + found - 1, 0.09 + (1 - rate) / rate
    return draw


def splats(reach):
    """Log-normal light subpaths, each of which adds its value to `reach` neighbouring pixels."""
    def draw(rng, shape, samples):
        few, variance = log_normal(0.75)(rng, (*shape[:-1], shape[-1] // reach), samples)
        return np.repeat(few, reach, axis=-1), variance
    return draw


# name, draw, pixels, samples of a batch, seeds, batches of a seed
CASES = (
    ("normal", normal, 1024, 4, 3, BATCHES), ("normal, 2 seeds", normal, 1024, 4, 2, BATCHES), ("splats on 8 pixels", splats(8), 2048, 4, 3, BATCHES),
    ("log-normal 0.5", log_normal(0.5), 1024, 4, 3, BATCHES), ("log-normal 1", log_normal(1.0), 1024, 4, 3, BATCHES),
    ("log-normal 1.5", log_normal(1.5), 1024, 4, 3, BATCHES), ("log-normal 2", log_normal(2.0), 1024, 4, 3, BATCHES),
    ("1 in 1e5, 0.2 met", outliers(1e-5), 128, 4, 3, BATCHES), ("1 in 1e5, 2 met", outliers(1e-5), 1024, 4, 3, BATCHES),
    ("1 in 1e5, 30 met", outliers(1e-5), 4096, 16, 3, BATCHES), ("1 in 1e5, 500 met", outliers(1e-5), 8192, 128, 3, BATCHES),
    ("1 in 1e5, 2000 met", outliers(1e-5), 8192, 512, 3, BATCHES),
    ("seeds: normal, 3", normal, 4096, 16, 3, 1), ("seeds: log-normal 1, 3", log_normal(1.0), 4096, 16, 3, 1),
    ("seeds: log-normal 1.5, 4", log_normal(1.5), 4096, 16, 4, 1), ("seeds: 1 in 1e5, 3", outliers(1e-5), 4096, 64, 3, 1),
    ("seeds: log-normal 1, 16", log_normal(1.0), 4096, 16, 16, 1),
)


def interval(errors, samples):
    """Judged of the variance of a sample, as the tables make it. `errors`: of shape (seeds, batches, pixels)."""
    values = samples * (errors**2).mean(axis=2)
    seeds, batches, pixels = errors.shape
    if batches > 1:
        whole = samples * batches * (errors.mean(axis=1) ** 2).mean(axis=1)
        return heavy_tails.estimate([(1, values.ravel())], "batches", heavy_tails.doubt_of_batches(list(values), list(whole), heavy_tails.SAME_METHOD))
    worst = max(1, pixels // 1000)
    ordered = np.sort(errors[:, 0] ** 2, axis=1)
    few = ordered.mean(axis=1) / ordered[:, :-worst].mean(axis=1)
    return heavy_tails.estimate([(1, values.ravel())], "seeds", heavy_tails.doubt_of_seeds(values.ravel(), list(few)),
                                by_bootstrap=seeds >= heavy_tails.FEWEST_RESAMPLED_SEEDS)


def simulate(case, trials, seed=1):
    """(share stated, coverage of those, share stated and wrong)."""
    _, draw, pixels, samples, seeds, batches = case
    rng = np.random.default_rng(seed)
    stated = covered = 0
    for _ in range(trials):
        errors, variance = draw(rng, (seeds, batches, pixels), samples)
        found = interval(errors, samples)
        stated += found.trusted
        covered += found.trusted and found.low <= variance <= found.high
    return stated / trials, covered / stated if stated else float("nan"), (stated - covered) / trials


def work(rng, error, seconds, seeds, spread, batches=BATCHES):
    """efficiency.Work of a run whose renders take `spread` more or less time each: a busy machine slows a whole render down, with all of its batches."""
    errors = error * rng.gamma(40, 1 / 40, (seeds * batches, 1))
    return efficiency.Work(errors, "batches", "", {seed: seconds * float(np.exp(spread * rng.normal())) for seed in range(1, seeds + 1)})


def simulate_times(seeds, spread, trials, seed=12):
    """(coverage of the ratio of two runs, share of ratios that differ from 1 at 5 % where there is no difference)."""
    rng = np.random.default_rng(seed)
    covered = tests = 0
    for _ in range(trials):
        run = work(rng, 1.0, 2.0, seeds, spread)
        found = efficiency.ratio(run, work(rng, 2.0, 3.0, seeds, spread), "base")
        covered += found.low <= 3 <= found.high
        tests += efficiency.ratio(run, work(rng, 1.0, 2.0, seeds, spread), "base", for_test=True).p < 0.05
    return covered / trials, tests / trials


TIMES = ((3, 0.0), (3, 0.01), (3, 0.1), (2, 0.05), (10, 0.1))  # seeds, spread of the times of renders


def main():
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    print(f"{'case':28} {'stated':>7} {'covers':>7} {'wrong of all':>13}")
    for case in CASES:
        stated, covers, wrong = simulate(case, trials)
        print(f"{case[0]:28} {stated:7.3f} {covers:7.3f} {wrong:13.3f}", flush=True)
    print(f"{'ratio where times vary':28} {'covers':>7} {'p < 5 %':>8}")
    for seeds, spread in TIMES:
        print(f"{f'{seeds} seeds, {spread:.0%}':28} " + "{:7.3f} {:8.3f}".format(*simulate_times(seeds, spread, trials)), flush=True)


if __name__ == "__main__":
    main()
