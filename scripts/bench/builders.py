#!/usr/bin/env python3
"""Seconds that the good and the fast builder take, and how fast rays are through what they build.

    scripts/bench/builders.py PROGRAM [SCENE...] [--triangles N] [--cpu] [--repetitions N]

Prints a table with a row for each scene, and for a bumpy sphere of N triangles: seconds and bytes of both structures,
and for each batch of `ambilux bench rays` the rays through the fast one over those through the good one. Without --cpu
rays are traced on a CUDA device, which also runs the fast builder.
"""

import argparse
import json
import math
import subprocess
import tempfile
from pathlib import Path

import numpy as np

SCENE = """<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="512"/><integer name="height" value="512"/></film></sensor>
    <emitter type="constant"/>
    <shape type="ply"><string name="filename" value="sphere.ply"/><bsdf type="diffuse"/></shape>
</scene>
"""


def write_sphere(folder, triangles):
    """A scene of about so many triangles of similar sizes, 2 n by n cells of a sphere with bumps; its path."""
    n = max(2, round(math.sqrt(triangles) / 2))
    v, u = np.meshgrid(np.linspace(0.01, math.pi - 0.01, n + 1), np.linspace(0, 2 * math.pi, 2 * n + 1), indexing="ij")
    radius = 1 + 0.05 * np.sin(40 * u) * np.sin(31 * v) + 0.002 * np.sin(977 * u + 3 * v) * np.sin(811 * v)
    points = np.stack([radius * np.sin(v) * np.cos(u), radius * np.cos(v), radius * np.sin(v) * np.sin(u)], axis=-1)
    corner = (np.arange(n)[:, None] * (2 * n + 1) + np.arange(2 * n)[None, :]).ravel()
    below = corner + 2 * n + 1
    faces = np.empty(2 * len(corner), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    faces["corners"][0::2] = np.stack([corner, corner + 1, below], axis=-1)
    faces["corners"][1::2] = np.stack([corner + 1, below + 1, below], axis=-1)
    with open(folder / "sphere.ply", "wb") as file:
        file.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % ((n + 1) * (2 * n + 1)))
        file.write(b"property float x\nproperty float y\nproperty float z\nelement face %d\n" % len(faces))
        file.write(b"property list uchar int vertex_indices\nend_header\n")
        file.write(points.astype("<f4").tobytes())
        file.write(faces.tobytes())
    path = folder / "sphere.xml"
    path.write_text(SCENE)
    return path, len(faces)


def rays(program, scene, backend, repetitions):
    command = [program, "bench", "rays", str(scene), "--backend", backend, "--repetitions", str(repetitions), "--json", "-"]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def best_rates(result):
    """By batch, of its kernels."""
    rates = {}
    for row in result["rows"]:
        rates[row["batch"]] = max(rates.get(row["batch"], 0), row["mrays_per_s"])
    return rates


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--triangles", type=int, default=0, help="of a generated sphere; 0: none")
    parser.add_argument("--cpu", action="store_true")
    parser.add_argument("--repetitions", type=int, default=25)
    o = parser.parse_args()
    if not o.scenes and not o.triangles:
        parser.error("give scenes, or --triangles")
    good_name, fast_name = ("cpu-cwbvh", "cpu-fast") if o.cpu else ("cuda", "cuda-fast")
    with tempfile.TemporaryDirectory() as folder:
        scenes = [(Path(path).parent.name if Path(path).name == "scene.xml" else Path(path).stem, path) for path in o.scenes]
        if o.triangles:
            path, count = write_sphere(Path(folder), o.triangles)
            scenes.append((f"sphere of {count}", path))
        for i, (name, path) in enumerate(scenes):
            good, fast = (rays(o.program, path, backend, o.repetitions) for backend in (good_name, fast_name))
            before, after = best_rates(good), best_rates(fast)
            ratios = {batch: after[batch] / rate for batch, rate in before.items() if rate > 0 and after[batch] > 0}
            if i == 0:
                print(good["device"])
                print("| scene | good: s | MB | fast: s | MB | " + " | ".join(before) + " | geometric mean |")
                print("| --- " * (len(before) + 6) + "|")
            mean = math.exp(sum(map(math.log, ratios.values())) / len(ratios))
            print(f"| {name} | {good['build_seconds']:.3f} | {good['accel_bytes'] / 1e6:.1f} | {fast['build_seconds']:.4f}"
                  f" | {fast['accel_bytes'] / 1e6:.1f} | "
                  + " | ".join(f"{ratios[b]:.2f}" if b in ratios else "-" for b in before) + f" | {mean:.2f} |", flush=True)


if __name__ == "__main__":
    main()
