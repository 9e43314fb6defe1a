#!/usr/bin/env python3
"""Random small scenes: integrators and variants against each other, and path beside Mitsuba 3. A long check, for a change that may touch anything.

    python scripts/checks/random_scenes.py build/cli/ambilux out/random --seed 1 --count 100
    python scripts/checks/random_scenes.py build/cli/ambilux out/random --seed 1 --count 100 --mitsuba mitsuba-venv/bin/python

Each scene is rendered by path, by bdpt and by two more methods that its seed picks; with --mitsuba, by Mitsuba too, and it then holds only what both have.
Means of blocks of 8x8 pixels and of the image are compared by Welch's t. What exceeds the bound is rendered again with other seeds and 4, then 16 times the
samples, because of heavy tails; it counts as a difference if it still exceeds it. Needs what requirements.txt lists and SciPy; for Mitsuba a Python with `mitsuba`.
"""

import argparse
import json
import os
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts" / "peers"), str(ROOT / "python")]
import plugin_scenes
import plugins
from ambilux.analysis.images import read_exr
from random_scene import RandomScene

BLOCK_BOUND, IMAGE_BOUND = 4.7, 4.2
BDPT = ["-i", "bdpt"]
METHODS = {
    "naive": ["--set", "estimator=naive"], "nee": ["--set", "estimator=nee"], "power": ["--set", "heuristic=power"], "uniform": ["--light-picking", "uniform"],
    "ris": ["--variant", "ris"], "double": ["--precision", "double"], "cwbvh": ["--set", "accel=cwbvh"], "instances": ["--limits", "copies=1"],
    "bvh2": ["--set", "accel=bvh2"], "on a CPU": [],
    "light": ["-i", "light"], "bdpt": BDPT, "bdpt power": BDPT + ["--set", "heuristic=power"], "bdpt double": BDPT + ["--precision", "double"],
    "bdpt cwbvh": BDPT + ["--set", "accel=cwbvh"], "megakernel": BDPT + ["--variant", "megakernel"], "streaming": BDPT + ["--variant", "streaming"],
    "lvc": BDPT + ["--variant", "lvc", "--set", "light_paths=2"], "learned": BDPT + ["--variant", "learned"],
    "four light subpaths": BDPT + ["--set", "strategies=hits+next_event+light", "--set", "light_paths=4"],
    "no light images": BDPT + ["--set", "strategies=hits+next_event+connections"],
}
MITSUBA = """
import sys, numpy as np, mitsuba as mi
mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)
path, out, seeds, spp, first = sys.argv[1:]
scene = mi.load_file(path)
np.save(out, np.stack([np.array(mi.render(scene, seed=int(first) + k, spp=int(spp)))[:, :, :3] for k in range(int(seeds))]))
"""


def write_image(path, rows, as_bytes):
    if as_bytes:
        return Image.fromarray(np.clip(np.rint(np.array(rows) * 255), 0, 255).astype(np.uint8)).save(path)
    import OpenEXR

    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": np.array(rows, dtype=np.float32)}).write(str(path))


def run(command):
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=3600)
    if done.returncode != 0:
        raise RuntimeError((done.stderr.strip() or f"exit code {done.returncode}").splitlines()[-1][-300:])


def shares_samples(method):
    return method in ("lvc", "learned")  # pixels draw from one cache: the spread of blocks over seeds counts


def render(options, path, method, first, spp, invalid):
    seeds = options.seeds * (2 if shares_samples(method) else 1)
    spp = max(1, spp * options.seeds // seeds)
    if method == "mitsuba":
        out = path.with_suffix(".npy")
        run([options.mitsuba, "-c", MITSUBA, str(path), str(out), str(seeds), str(spp), str(first)])
        return np.load(out).astype(np.float64)
    images, out, stats = [], path.with_suffix(".exr"), path.with_suffix(".json")
    for k in range(seeds):
        run([options.program, "render", str(path), "-o", str(out), "--spp", str(spp), "--seed", str(first + k), "--json", str(stats), "--backend", "cpu" if method == "on a CPU" else options.backend,
             *METHODS.get(method, [])])
        counts = json.loads(stats.read_text(encoding="utf-8"))["invalid"]
        for cause in ("nan", "inf", "negative"):
            invalid[cause] = invalid.get(cause, 0) + counts[cause]
        images.append(read_exr(out).astype(np.float64))
    return np.stack(images)


def compare(a, b, a_shares, b_shares, tolerance):
    """The largest |z| of a block, of the image, and the relative difference of means. Less than `tolerance` is no difference."""
    from scipy import stats

    sums = [(plugins.whole_blocks if shares else plugins.blocks)(x) for x, shares in ((a, a_shares), (b, b_shares))]
    means = [(v.mean((0, 1)), s.sum((0, 1)) / v[..., 0].size**2, n[0, 0] if shares else n.sum((0, 1))) for (v, s, n), shares in zip(sums, (a_shares, b_shares))]

    def largest(p, q):
        (x, vx, nx), (y, vy, ny) = p, q
        vx, vy = np.where(vx > 0, vx, vy), np.where(vy > 0, vy, vx)  # no bright sample yet tells nothing of the variance
        v = np.maximum(vx + vy, 1e-18)
        freedom = np.maximum(v**2 / np.maximum(vx**2 / nx + vy**2 / ny, 1e-300), 1)
        z = stats.norm.isf(np.maximum(stats.t.sf(abs(x - y) / np.sqrt(v), freedom), 1e-300))
        return float(np.where(abs(x - y) <= tolerance * np.maximum(abs(x), abs(y)) + 1e-7, 0, z).max())

    return largest(*sums), largest(*means), float(means[0][0].mean() / max(means[1][0].mean(), 1e-30) - 1)


def methods_of(scene, seed, options):
    """What is compared with path, and what with bdpt where path lacks some light."""
    has, choose = scene.has, random.Random(seed)
    lacks_light = "beam" in has or {"delta", "delta_light"} <= has
    on_cpu, instanced = options.backend == "cpu", "instance" in scene.tags
    path = ["nee", "power", "uniform", "ris"] + (["instances"] if instanced else []) + ([] if "delta_light" in has else ["naive"])
    path += ["double", "cwbvh"] if on_cpu else [] if instanced else ["bvh2"]
    bidirectional = ["bdpt power", "megakernel", "streaming", "lvc", "learned"] + (["bdpt double", "bdpt cwbvh"] if on_cpu else [])
    bidirectional += [] if lacks_light else ["no light images"]
    bidirectional += [] if lacks_light and "delta" in has else ["four light subpaths"]  # caustics seen through glass are for connections
    bidirectional += [] if {"delta", "hidden"} & has else ["light"]  # what it cannot see
    chosen = [(choose.choice(path), "path"), ("bdpt", "path"), (choose.choice(bidirectional), "bdpt" if lacks_light else "path")]
    passes_panes = {"null", "delta_light"} <= has and "thindielectric" in scene.tags  # shadow rays of Mitsuba's volpath
    chosen = [pair for pair in chosen if not (lacks_light and pair == ("bdpt", "path"))]
    return chosen + ([] if on_cpu else [("on a CPU", "path")]) + ([("mitsuba", "path")] if options.mitsuba and not passes_panes else [])


def check_scene(options, seed, totals):
    scene = RandomScene(seed, bool(options.mitsuba))
    path = options.folder / f"random_{seed}.xml"
    path.write_text(scene.text, encoding="utf-8")
    invalid, images, words = {}, {}, []

    def image(method, spp, first):
        key = method, spp
        if key not in images:
            images[key] = render(options, path, method, first + 100 * sum(map(ord, method)), spp, invalid)
        return images[key]

    for method, reference in methods_of(scene, seed, options):
        tolerance = 0 if method != "mitsuba" else 3e-3 if "sun" in scene.has else 1.5e-3 if "plastic" in scene.tags else 4e-4  # docs/scenes.md, and halves
        try:
            for factor in (1, 4, 16):
                pair = [image(m, factor * options.spp, 1 + 10**6 * factor) for m in (method, reference)]
                block, whole, difference = compare(*pair, shares_samples(method), False, max(tolerance, 3e-6))
                differs = block > BLOCK_BOUND or whole > IMAGE_BOUND
                if not differs:
                    break
            totals["comparisons"] += 1
            totals["again"] += factor > 1
            words.append(f"{method} {block:.1f} {whole:.1f} {100 * difference:+.2f} %" + (" (again)" if factor > 1 else ""))
            if differs:
                totals["differences"].append(f"{path}: {method} against {reference}: |z| of blocks {block:.1f}, of the image {whole:.1f}, mean {100 * difference:+.2f} %")
        except RuntimeError as problem:
            totals["refused"].append(f"{path}: {method}: {problem}")
            words.append(f"{method}: {problem}")
            if method != "mitsuba":
                break
    if sum(invalid.values()):
        totals["differences"].append(f"{path}: invalid values {invalid}")
    print(f"{seed}: {', '.join(sorted(scene.tags))} | {'; '.join(words)}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="ambilux")
    parser.add_argument("folder", type=Path, help="for scenes and images")
    parser.add_argument("--seed", type=int, default=1, help="of the first scene (default: %(default)s)")
    parser.add_argument("--count", type=int, default=20, help="scenes, of consecutive seeds (default: %(default)s)")
    parser.add_argument("--spp", type=int, default=24, help="samples per pixel and image (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=3, help="images of each (default: %(default)s)")
    parser.add_argument("--backend", default="cpu", help="of ambilux; path is compared with that of the cpu too (default: %(default)s)")
    parser.add_argument("--mitsuba", metavar="PYTHON", help="compare path with Mitsuba 3 of this Python")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    plugin_scenes.write_files(options.folder, write_image)
    totals = {"comparisons": 0, "again": 0, "differences": [], "refused": []}
    for seed in range(options.seed, options.seed + options.count):
        check_scene(options, seed, totals)
    print(f"\n{options.count} scenes, {totals['comparisons']} comparisons, {totals['again']} of them again with more samples; refused or failed: {len(totals['refused'])}; "
          f"differences: {len(totals['differences'])}")
    print(*totals["refused"], *totals["differences"], sep="\n")
    return 1 if totals["differences"] else 0


if __name__ == "__main__":
    sys.exit(main())
