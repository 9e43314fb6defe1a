"""What numbers of draws and of eye samples that vary by tile (8x8 pixels) could be worth: an oracle, in numpy.

Usage: scripts/bench/tile_bound.py measure OUT.npz SCENE WxH [--seconds 2.5] [--group 1]
       scripts/bench/tile_bound.py table OUT.npz...
`measure` renders every candidate twice, each for so many CPU seconds, and crops of the film for what a tile costs
(`--group 2`: crops of 2x2 tiles, for scenes that take long to load). Start it with `taskset -c N`, one thread each.
`table` chooses on one render and scores on the other, both ways. Figures are 1/(relMSE time) over the best single
candidate with the same number of eye samples in all pixels. `measure` needs PYTHONPATH=build-cpu/python.
"""

import argparse
import itertools
import pathlib
import re
import tempfile
import time

import numpy as np

TILE, DEPTH = 8, 8
DRAWS = [0, 1, 4, 16]
LIGHT = [1 / 16, 1 / 4, 1, 4]  # light subpaths per pixel that weights know of
SAMPLES = 2.0 ** np.arange(-3, 3.01, 0.25)  # eye samples of a tile's pixel
TRIMS = [0, 0.001, 0.01]
PRICES = 2.0 ** np.arange(-12, 12.1, 0.25)  # of time, over its mean


def write_scene(path, folder, width, height, crop=None):
    """A copy of the scene with another film, beside links to its files."""
    film = {"width": width, "height": height}
    if crop:
        film |= dict(zip(("crop_offset_x", "crop_offset_y", "crop_width", "crop_height"), crop))
    text = "".join(f'<integer name="{k}" value="{v}"/>' for k, v in film.items())
    for source in path.resolve().parent.iterdir():
        to = folder / source.name
        to.unlink(missing_ok=True)
        if source.suffix == ".xml":
            xml = re.sub(r'<integer\s+name="(width|height|crop_\w+)"[^>]*/>', "", source.read_text())
            to.write_text(re.sub(r"(<film[^>]*>)", lambda m: m[1] + text, xml))
        else:
            to.symlink_to(source)
    assets = path.resolve().parent.parent / "assets"
    if assets.exists() and not (folder.parent / "assets").exists():
        (folder.parent / "assets").symlink_to(assets)
    return folder / path.name


def arguments(draws, light=None):
    """Of ambilux.render; draws None: the path tracer."""
    if draws is None:
        return {"integrator": "path"}
    settings = {"light_paths": light} | ({"connections": draws} if draws else {"strategies": ["hits", "next_event", "light"]})
    return {"integrator": "bdpt", "variant": "lvc", "settings": settings}


def rendered(scene, seconds, seed, **what):
    """Image, and CPU seconds of a sample of a pixel, without what a render starts with."""
    import ambilux

    def timed(spp, seed):
        start = time.process_time()
        image = ambilux.render(scene, spp=spp, seed=seed, max_depth=DEPTH, backend="cpu", **what)
        return time.process_time() - start, image

    few, more = timed(2, 1000)[0], timed(10, 1000)[0]
    each = max((more - few) / 8, 1e-5)
    count = int(np.clip(seconds / each, 16, 100000))
    total, image = timed(count, seed)
    return image, max(total - (few - 2 * each), 0.1 * total) / count / image.rgb[..., 0].size


def measure(out, path, width, height, seconds, group):
    import ambilux
    with tempfile.TemporaryDirectory() as top:
        folder = pathlib.Path(top) / "scene"
        folder.mkdir()
        scene = ambilux.load(write_scene(path, folder, width, height))
        candidates = [(None, None), *itertools.product(DRAWS, LIGHT)]
        mean, variance, cost, spp = [], [], [], []
        for c in candidates:
            runs = [rendered(scene, seconds, seed, **arguments(*c)) for seed in (1, 2)]
            mean.append([i.rgb.copy() for i, _ in runs])
            variance.append([i.variance.copy() for i, _ in runs])
            cost.append([t for _, t in runs])
            spp.append([i.stats["spp"] for i, _ in runs])
            print(path, c, f"{1e6 * np.mean(cost[-1]):.2f} us", spp[-1], flush=True)
        # Four times the resolution, so that a crop of one tile has full waves.
        edge, zoom = TILE * group, 4
        tile_cost = np.zeros((4, height // TILE, width // TILE))
        for y, x in itertools.product(range(0, height, edge), range(0, width, edge)):
            w, h = min(edge, width - x), min(edge, height - y)
            crop = ambilux.load(write_scene(path, folder, width * zoom, height * zoom, (x * zoom, y * zoom, w * zoom, h * zoom)))
            for k, draws in enumerate((None, 0, 1, 16)):
                tile_cost[k, y // TILE:(y + h) // TILE, x // TILE:(x + w) // TILE] = rendered(crop, 0.03 * group**2, 3, **arguments(draws, 1 / 4))[1]
    np.savez(out, mean=mean, variance=variance, cost=cost, spp=spp, tile_cost=tile_cost)


def tiles(pixels, keep):
    """Sum of each tile over the kept pixels, over the number of pixels of the film that are kept."""
    h, w = pixels.shape
    return (pixels * keep).reshape(h // TILE, TILE, w // TILE, TILE).sum((1, 3)).ravel() / keep.sum()


class Scene:
    """By half: relative variance of one sample in every tile. Methods: the path tracer, then DRAWS."""

    def __init__(self, data, trim):
        mean, cost = data["mean"], data["cost"].mean(1)
        truth = mean[1:].mean((0, 1)).astype(float)
        scale = truth**2 + 0.01
        variance = (data["variance"] / scale).mean(-1)
        keep = np.ones(truth.shape[:2])
        if trim:
            worst = variance[1:].mean((0, 1))
            keep = (worst <= np.quantile(worst, 1 - trim, method="lower")).astype(float)
        v = np.array([[tiles(variance[c, half], keep) for c in range(len(variance))] for half in (0, 1)])
        # Light that the path tracer has missed is not in its variance: its distance from the others' mean tells.
        missed = [tiles(((mean[0, half] - truth) ** 2 / scale).mean(-1) * data["spp"][0, half], keep) for half in (0, 1)]
        self.path = np.where(np.array(missed) > 2 * v[:, 0], missed, v[:, 0])
        self.v = v[:, 1:].reshape(2, len(DRAWS), len(LIGHT), -1)
        # Cost of the eye side by tile: what crops say, scaled to what the whole image takes.
        grid = cost[1:].reshape(len(DRAWS), len(LIGHT))
        light = np.array(LIGHT)
        self.light = max(((grid - grid.mean(1, keepdims=True)) * (light - light.mean())).sum() / (len(DRAWS) * ((light - light.mean()) ** 2).sum()), 0)
        eye = np.maximum((grid - self.light * light).mean(1), 0.1 * grid.min())
        crops = data["tile_cost"].reshape(4, -1).copy()
        crops[1:] = np.maximum(crops[1:] - self.light / 4, 0.1 * crops[1:])
        crops = np.array([*crops[:3], crops[2] + (crops[3] - crops[2]) * 3 / 15, crops[3]])
        area = np.full(crops.shape[1], 1 / crops.shape[1])
        whole = np.array([cost[0], *eye])
        self.e = crops / (crops * area).sum(1, keepdims=True) * whole[:, None] * area

    def variance(self, half, light, samples):
        """[method, samples, tile]: light subpaths per pixel are `light`, weights know of light / samples."""
        v = self.v[half]
        at = np.clip(np.log2(light / samples), np.log2(LIGHT[0]), np.log2(LIGHT[-1]))
        position = np.interp(at, np.log2(LIGHT), np.arange(len(LIGHT)))
        i = np.minimum(position.astype(int), len(LIGHT) - 2)
        f = (position - i)[None, :, None]
        bdpt = v[:, i] * (1 - f) + v[:, i + 1] * f
        return np.concatenate([np.broadcast_to(self.path[half], (1, len(samples), v.shape[-1])), bdpt]) / samples[None, :, None]

    def best(self, methods, samples, lights, same=False):
        """Variance times cost if every tile takes whichever of `methods` and of `samples`, and all together one of
        `lights`, is best on one half, scored on the other (or the `same`): geometric mean of both ways."""
        scores = []
        for half in (0, 1):
            least = (np.inf, 0)
            for light in lights:
                chosen, scored = (self.variance(h, light or 1e-9, samples)[methods].reshape(-1, self.e.shape[1])
                                  for h in (half, half if same else 1 - half))
                cost = (self.e[methods][:, None, :] * samples[None, :, None]).reshape(chosen.shape)
                tile = np.arange(chosen.shape[1])
                for price in [0.0] if len(chosen) == 1 else chosen.mean() / cost.mean() * PRICES:
                    pick = np.argmin(chosen + price * cost, 0)
                    time = cost[pick, tile].sum() + light * self.light
                    least = min(least, (chosen[pick, tile].sum() * time, scored[pick, tile].sum() * time))
            scores.append(least)
        return np.sqrt(np.prod(scores, 0))

    def table(self, same=False):
        """Name of the best single candidate; gains by draws of each tile, by eye samples, by both. The path tracer has all
        tiles or none: too few samples tell in which of them it misses light. What all tiles share is chosen by both
        halves: a whole image tells it better than tiles tell theirs."""
        one, fine = np.ones(1), 2.0 ** np.arange(-4, 2.01, 0.5)
        bdpt = list(range(1, 1 + len(DRAWS)))
        singles = {"path": self.best([0], one, [0], same)}
        singles |= {f"{DRAWS[m - 1]} draws, {light:g}": self.best([m], one, [light], same) for m in bdpt for light in LIGHT}
        name = min(singles, key=lambda n: singles[n][0])
        path = self.best([0], SAMPLES, [0], same)
        varied = [[singles["path"], self.best(bdpt, one, LIGHT, same)],
                  [path, *(self.best([m], SAMPLES, fine, same) for m in bdpt)],
                  [path, self.best(bdpt, SAMPLES, fine, same)]]
        return name, [singles[name][1] / min(v, key=lambda x: x[0])[1] for v in varied]


def print_table(files):
    for trim in TRIMS:
        print(f"without the worst {100 * trim:g} % of the pixels: best single candidate (draws, light subpaths per pixel), "
              "draws by tile, eye samples by tile, both")
        scenes = [Scene(np.load(f), trim) for f in files]
        rows = [s.table() for s in scenes]
        for f, (name, gains) in zip(files, rows):
            print(f"| {pathlib.Path(f).stem} | {name} | " + " | ".join(f"{x:.2f}" for x in gains) + " |")
        for what, gains in (("geometric mean", [g for _, g in rows]), ("the same, scored where it was chosen", [s.table(True)[1] for s in scenes])):
            print(f"| {what} | | " + " | ".join(f"{x:.2f}" for x in np.exp(np.log(gains).mean(0))) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    m = commands.add_parser("measure")
    m.add_argument("out")
    m.add_argument("scene", type=pathlib.Path)
    m.add_argument("size")
    m.add_argument("--seconds", type=float, default=2.5)
    m.add_argument("--group", type=int, default=1)
    commands.add_parser("table").add_argument("files", nargs="+")
    a = parser.parse_args()
    if a.command == "measure":
        measure(a.out, a.scene, *map(int, a.size.split("x")), a.seconds, a.group)
    else:
        print_table(a.files)


if __name__ == "__main__":
    main()
