#!/usr/bin/env python3
"""Images a second (docs/performance.md): `ambilux bench frames` at 1920x1080 and depth 8, of several scenes, methods and budgets of memory.

    scripts/bench/bench_frames.py PROGRAM SCENE... [--memory 4G 1G 256M] [--frames N] [--backend cuda]

Prints a table of frames per second by the median, milliseconds by the 95th percentile, and MiB at most.
"""

import json
import subprocess

from scenes_and_methods import name_of, parser_for

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


def main():
    parser = parser_for(__doc__)
    parser.add_argument("--memory", nargs="+", default=["4G"])
    parser.add_argument("--frames", type=int, default=100)
    a = parser.parse_args()
    print("| scene | memory | " + " | ".join(METHODS) + " |\n| --- | --- |" + " --- |" * len(METHODS))
    for scene in a.scenes:
        for memory in a.memory:
            print(f"| {name_of(scene)} | {memory} | " + " | ".join(frames(a, scene, m, memory) for m in METHODS) + " |", flush=True)


if __name__ == "__main__":
    main()
