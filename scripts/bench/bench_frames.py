#!/usr/bin/env python3
"""Images a second (docs/performance.md): `ambilux bench frames` at 1920x1080 and depth 8, of several scenes, methods and budgets of memory.

    scripts/bench/bench_frames.py PROGRAM SCENE... [--memory 4G 1G 256M] [--frames N] [--backend cuda]

Prints a table of frames per second by the median, milliseconds by the 95th percentile, and MiB at most.
"""

import argparse
import json
import pathlib
import subprocess

METHODS = {
    "path": ["-i", "path"],
    "bdpt wavefront": ["-i", "bdpt"],
    "bdpt lvc, 1 draw": ["-i", "bdpt", "--variant", "lvc", "--set", "connections=1"],
    "bdpt lvc, 3 draws": ["-i", "bdpt", "--variant", "lvc"],
    "bdpt streaming": ["-i", "bdpt", "--variant", "streaming"],
}


def frames(a, scene, method, memory):
    """The cell of the table, or why there is none."""
    command = [a.program, "bench", "frames", scene, "--backend", a.backend, "--size", a.size, "--max-depth", "8", "--memory", memory,
               "--frames", str(a.frames), "--json", "-", *METHODS[method]]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        return (done.stderr.strip().splitlines() or [f"code {done.returncode}"])[-1]
    told = json.loads(done.stdout)
    return f"{told['frames_per_second']:.1f}, {1000 * told['percentile_95_seconds']:.1f} ms, {told['memory_bytes_peak'] >> 20} MiB"


def name_of(scene):
    path = pathlib.Path(scene)
    return path.parent.name if path.stem == "scene" else path.stem


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--memory", nargs="+", default=["4G"])
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--backend", default="cuda")
    a = parser.parse_args()
    print("| scene | memory | " + " | ".join(METHODS) + " |\n| --- | --- |" + " --- |" * len(METHODS))
    for scene in a.scenes:
        for memory in a.memory:
            print(f"| {name_of(scene)} | {memory} | " + " | ".join(frames(a, scene, m, memory) for m in METHODS) + " |", flush=True)


if __name__ == "__main__":
    main()
