#!/usr/bin/env python3
"""Every plugin beside Mitsuba 3: small scenes rendered by both, a z-test of blocks of pixels, a table.

    python -m venv mitsuba-venv && mitsuba-venv/bin/pip install mitsuba numpy scipy
    mitsuba-venv/bin/python scripts/peers/plugins.py build/cli/ambilux out/plugins --table out/plugins.md

Names behind the folder restrict it to scenes that begin with one of them. What the folder has of a scene already is not measured again.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import plugin_scenes

BLOCK = 8
LEVEL = 0.01  # chance that any block of any scene fails though all is well


def blocks(images):
    """Means of blocks, and the variances of these, of images with independent pixels: (values, variances, degrees of freedom)."""
    import numpy as np

    n, h, w, c = images.shape
    shape = (h // BLOCK, BLOCK, w // BLOCK, BLOCK, c)
    value = images.mean(axis=0).reshape(shape).mean(axis=(1, 3))
    pixels = (images.var(axis=0, ddof=1) / n).reshape(shape)
    variance = pixels.sum(axis=(1, 3))
    # Satterthwaite 1946: degrees of freedom of a sum of variances.
    freedom = (n - 1) * variance**2 / np.maximum((pixels**2).sum(axis=(1, 3)), 1e-300)
    return value, variance / BLOCK**4, np.maximum(freedom, n - 1)


def whole_blocks(images):
    """The same of images whose pixels share samples: from the spread of the blocks."""
    n, h, w, c = images.shape
    each = images.reshape(n, h // BLOCK, BLOCK, w // BLOCK, BLOCK, c).mean(axis=(2, 4))
    return each.mean(axis=0), each.var(axis=0, ddof=1) / n, (n - 1) + 0 * each[0]


def z_values(ours, theirs, shared):
    """z of the blocks: Welch's t, as the normal variate of the same probability."""
    import numpy as np
    from scipy import stats

    (a, va, na), (b, vb, nb) = ((whole_blocks if shared else blocks)(x) for x in (ours, theirs))
    v = va + vb
    # Both have no noise where light comes straight from an emitter; then they must agree to rounding.
    v = np.maximum(v, (3e-6 * np.maximum(abs(a), abs(b)) + 1e-9)**2)
    freedom = np.maximum(v**2 / np.maximum(va**2 / na + vb**2 / nb, 1e-300), 1)
    t = (a - b) / np.sqrt(v)
    return np.sign(t) * np.minimum(stats.norm.isf(np.maximum(stats.t.sf(abs(t), freedom), 1e-300)), 38)


def of_mitsuba(path, seeds, spp):
    import mitsuba as mi
    import numpy as np

    loaded = mi.load_file(str(path))
    return np.stack([np.array(mi.render(loaded, seed=100 + s, spp=spp), dtype=np.float64)[:, :, :3] for s in range(seeds)])


def is_light_traced(text):
    return 'integrator type="ptracer"' in text


def of_ours(program, path, seeds, spp):
    import mitsuba as mi
    import numpy as np

    images = []
    integrator = "light" if is_light_traced(path.read_text(encoding="utf-8")) else "path"
    for s in range(seeds):
        out = path.with_suffix(".exr")
        command = [program, "render", str(path), "-o", str(out), "--spp", str(spp), "--seed", str(s + 1), "-i", integrator, "--backend", "cpu"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError((done.stderr or done.stdout).strip().splitlines()[-1])
        image = np.array(mi.Bitmap(str(out)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        images.append(image.astype(np.float64))
    return np.stack(images)


def compare(options, name, text):
    """The relative difference of the means, its error, the largest |z| of blocks and how many there are."""
    import numpy as np

    path = options.folder / (name.replace(" ", "_") + ".xml")
    known = path.with_suffix(".json")
    asked = {"text": text, "spp": options.spp, "seeds": options.seeds, "variant": options.variant}
    if known.exists():
        result = json.loads(known.read_text(encoding="utf-8"))
        if all(result[key] == value for key, value in asked.items()):
            return result
    path.write_text(text, encoding="utf-8")
    shared = plugin_scenes.BOX not in text or is_light_traced(text)
    seeds = options.seeds * (4 if shared else 1)
    spp = max(1, options.spp * options.seeds // seeds)
    theirs = of_mitsuba(path, seeds, spp)
    ours = of_ours(options.program, path, seeds, spp)
    z = z_values(ours, theirs, shared)
    means = [x.mean(axis=(1, 2, 3)) for x in (ours, theirs)]
    error = np.sqrt(sum(m.var(ddof=1) / len(m) for m in means))
    mean = means[1].mean()
    result = {**asked, "difference": (means[0].mean() - mean) / mean, "error": error / mean, "z": float(abs(z).max()), "tests": z.size}
    known.write_text(json.dumps(result), encoding="utf-8")
    return result


def write_image(path, rows, as_bytes):
    import mitsuba as mi
    import numpy as np

    image = mi.Bitmap(np.array(rows, dtype=np.float32))
    if as_bytes:
        image = mi.Bitmap(np.clip(np.rint(np.array(rows) * 255), 0, 255).astype(np.uint8))
    image.write(str(path))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="ambilux")
    parser.add_argument("folder", type=Path, help="for scenes and images")
    parser.add_argument("names", nargs="*", help="only scenes that begin so")
    parser.add_argument("--spp", type=int, default=256, help="samples per pixel and seed (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=4, help="images of each (default: %(default)s)")
    parser.add_argument("--variant", default="scalar_rgb", help="of Mitsuba (default: %(default)s)")
    parser.add_argument("--table", type=Path, help="file for the table")
    options = parser.parse_args()
    import mitsuba as mi
    from scipy import stats

    mi.set_variant(options.variant)
    mi.set_log_level(mi.LogLevel.Error)
    options.folder.mkdir(parents=True, exist_ok=True)
    plugin_scenes.write_files(options.folder, write_image)
    scenes = {k: t for k, t in plugin_scenes.catalogue().items() if not options.names or any(k.startswith(n) for n in options.names)}
    results = {}
    for name, text in scenes.items():
        begin = time.monotonic()
        try:
            results[name] = r = compare(options, name, text)
            print(f"{name}: {100 * r['difference']:+.3f} ± {100 * r['error']:.3f} %, |z| up to {r['z']:.2f}, {time.monotonic() - begin:.1f} s", file=sys.stderr)
        except RuntimeError as problem:
            results[name] = str(problem).splitlines()[-1]
            print(f"{name}: {results[name]}", file=sys.stderr)
    tests = sum(r["tests"] for r in results.values() if isinstance(r, dict))
    # Sidak 1967, for tests on both sides.
    bound = stats.norm.isf(-0.5 * math.expm1(math.log1p(-LEVEL) / max(tests, 1)))
    lines = [f"Mitsuba {mi.__version__} ({options.variant}), {options.seeds} seeds of {options.spp} samples per pixel; {tests} tests, |z| may be "
             f"{bound:.2f}", "", "| scene | mean, ours to Mitsuba's, % | largest abs(z) | |", "| --- | --- | --- | --- |"]
    agrees = True
    for name, r in results.items():
        if isinstance(r, str):
            lines.append(f"| {name} | | | {r} |")
        else:
            lines.append(f"| {name} | {100 * r['difference']:+.3f} ± {100 * r['error']:.3f} | {r['z']:.2f} | {'agrees' if r['z'] <= bound else '**differs**'} |")
        agrees &= isinstance(r, dict) and r["z"] <= bound
    print("\n".join(lines))
    if options.table:
        options.table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0 if agrees else 1


if __name__ == "__main__":
    sys.exit(main())
