#!/usr/bin/env python3
"""Seconds from the start of the program to the first image on a device, and what they are made of (docs/performance.md).

    scripts/bench/first_image.py PROGRAM SCENE... [--size 1920x1080] [--methods path "bdpt lvc"] [--ptx] [--repeat 3] [--json OUT.json]

Each is a process of its own that renders one sample of every pixel and writes it. `load`: the scene; `device`: the driver and its context; `structure`: what rays go
through, built on the host; `kernels`: loaded, or compiled from PTX, and made graphs of; `upload`: the rest of the build; `sample`; `rest`: the process, its libraries,
the image file. The median of the repetitions, by the wall clock. With --ptx also from PTX by force, once with an empty cache of the driver and then with it, for builds
that hold PTX (`ambilux devices` says so).
"""

import json
import os
import pathlib
import statistics
import subprocess
import tempfile
import time

from scenes_and_methods import name_of, parser_for, settings_of

PARTS = ("load", "device", "structure", "upload", "kernels", "sample", "rest")


def first_image(a, scene, method, environment):
    """Seconds of all, and by part."""
    with tempfile.TemporaryDirectory() as folder:
        stats = pathlib.Path(folder) / "stats.json"
        command = [a.program, "render", scene, "-o", f"{folder}/first.exr", "--spp", "1", "--backend", a.backend, "--size", a.size, "--max-depth", "8",
                   "--json", stats, *(word for setting in settings_of(method) for word in ("--set", "=".join(setting)))]
        start = time.perf_counter()
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, env={**os.environ, **environment})
        whole = time.perf_counter() - start
        if done.returncode:
            raise SystemExit(f"{scene}, {method}: {done.stderr.strip()}")
        s = json.loads(stats.read_text())["seconds"]
    parts = {"load": s["load"], "device": s["device"], "structure": s["structure"], "upload": s["build"] - s["structure"] - s["kernels"], "kernels": s["kernels"],
             "sample": s["render"]}
    return {"all": whole, **parts, "rest": whole - sum(parts.values())}


def median_of(runs):
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


def main():
    parser = parser_for(__doc__, methods=True)
    parser.add_argument("--ptx", action="store_true")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", help="write all figures to this file")
    a = parser.parse_args()
    print(f"| scene, {a.size} | method | kernels from | all | " + " | ".join(PARTS) + " |\n" + "| --- " * (4 + len(PARTS)) + "|")
    rows = []

    def report(scene, method, source, runs):
        row = {"scene": name_of(scene), "method": method, "kernels_from": source, **median_of(runs)}
        rows.append(row)
        print(f"| {row['scene']} | {method} | {source} | {row['all']:.2f} | " + " | ".join(f"{row[p]:.3f}" for p in PARTS) + " |", flush=True)

    for scene in a.scenes:
        for method in a.methods:
            report(scene, method, "as built", [first_image(a, scene, method, {}) for _ in range(a.repeat)])
            if a.ptx:
                with tempfile.TemporaryDirectory() as cache:
                    forced = {"CUDA_FORCE_PTX_JIT": "1", "CUDA_CACHE_PATH": cache, "CUDA_CACHE_MAXSIZE": str(1 << 30)}
                    report(scene, method, "PTX, first start", [first_image(a, scene, method, forced)])
                    report(scene, method, "PTX, from the cache", [first_image(a, scene, method, forced) for _ in range(a.repeat)])
    if a.json:
        pathlib.Path(a.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
