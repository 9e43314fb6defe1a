"""Runs that make the same images at equal seeds: what differs is time alone, and time per sample is measured directly, without the noise of errors."""

import math

import numpy as np

from ambilux.analysis import heavy_tails, images, statistics

EQUAL = 1e-4  # relative difference of recorded errors that rounding may make: another order of sums, another backend
ALIKE = 0.05  # up to which images are looked at: rounding may have sent single paths another way
PIXEL = 1e-3  # relative difference from which on a pixel differs
FEW_PIXELS = 0.01  # share of the pixels in which images of one estimator may differ; Russian roulette from another depth on changes 4 % of them on cornell
COMPARED = ("rmse", "relmse", "mape")
OVER = "pairs of seeds"


def same(experiment, scene, run, base):
    """Whether two runs are the same estimator: at every seed and number of samples that both have recorded, at two of them or more, their images' errors
    are equal, or nearly so and the images themselves are equal but for few pixels. None if they share less, as with budgets in seconds alone."""
    own, other = ({(r.seed, r.spp): r for r in experiment.select(scene, name)} for name in (run, base))
    common = own.keys() & other.keys()
    if len(common) < 2:
        return None
    difference = max(abs(a - b) / max(abs(a), abs(b), 1e-30) for k in common for m in COMPARED for a, b in [(getattr(own[k], m), getattr(other[k], m))])
    return difference <= EQUAL or (difference <= ALIKE and same_images(experiment, scene, run, base))


def same_images(experiment, scene, run, base):
    """Whether the images of equal seeds with equal samples differ in few pixels; False without such images."""
    files = [dict(experiment.files("images", scene, name, ".exr")) for name in (run, base)]
    samples = [{r.seed: r.spp for r in experiment.select(scene, name)} for name in (run, base)]  # of the last checkpoint, which the image is of
    shares = []
    for seed in sorted(files[0].keys() & files[1].keys()):
        if samples[0].get(seed) != samples[1].get(seed):
            continue
        other = images.read_exr(files[1][seed])
        own = images.read_like(files[0][seed], other)
        shares.append(float((np.abs(own - other) > PIXEL * (np.abs(other) + 1e-3)).any(axis=2).mean()))
    return bool(shares) and max(shares) <= FEW_PIXELS


def seconds_per_sample(experiment, scene, run):
    """{seed: seconds of a sample per pixel}, over the whole render."""
    return {r.seed: r.time / r.spp for r in sorted(experiment.select(scene, run), key=lambda r: r.spp)}


def time_ratio(experiment, scene, run, base):
    """Judged of the base's time per sample over the run's, above 1 if the run is faster: geometric mean over seeds with Student's interval of pairs, since
    a busy machine slows all samples of a render together and only renders are independent."""
    own, other = (seconds_per_sample(experiment, scene, name) for name in (run, base))
    seeds = sorted(own.keys() & other.keys())
    if len(seeds) < 2:
        return heavy_tails.unknown(math.nan if not seeds else other[seeds[0]] / own[seeds[0]], OVER, len(seeds), f"{len(seeds)} seed{'s' if len(seeds) != 1 else ''}")
    e = statistics.ratio_of_pairs([other[s] for s in seeds], [own[s] for s in seeds])
    return heavy_tails.Judged(e.value, e.low, e.high, statistics.two_sided_p(math.log(e.value), e.error, 0.0, len(seeds)), OVER, len(seeds))
