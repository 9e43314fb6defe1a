#!/usr/bin/env python3
"""Renders the scenes of `ambilux stress --export DIR` with another Ambilux, such as that of an earlier revision, and writes what `ambilux
stress --judge` reads.

    ambilux stress --export scenes
    scripts/peers/stress_revision.py earlier/build/cli/ambilux scenes earlier.csv --jobs 16
    ambilux stress --judge earlier.csv -o earlier
    python -m ambilux.analysis.stress out/stress -o figures --before earlier

Each batch is a render of its own with a seed of its own, on a core of its own. Lines that are there already are not made again.
"""

import argparse
import concurrent.futures
import json
import os
import queue
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as xml
from pathlib import Path

from stress_table import BATCHES, BOXES, Table, box_means, failed, measured, not_finished

METHODS = {
    "path-nee": ["-i", "path", "--set", "estimator=nee"],
    "path-mis": ["-i", "path"],
    "light": ["-i", "light"],
    "bdpt": ["-i", "bdpt", "--variant", "wavefront"],
    "lvc": ["-i", "bdpt", "--variant", "lvc", "--set", "connections=1"],
}


def film_size(scene):
    film = xml.parse(scene).getroot().find("sensor/film")
    numbers = {e.get("name"): int(e.get("value")) for e in film.findall("integer")}
    return numbers["width"], numbers["height"]


def render(options, scene, how, core):
    """The columns of a line behind `backend`."""
    import OpenEXR

    width, height = film_size(scene)
    spp = max(1, round(options.paths / (BATCHES * width * height)))
    boxes_x, boxes_y = min(BOXES, width), min(BOXES, height)
    values, invalid, start = [], 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        image, told = Path(folder) / "image.exr", Path(folder) / "told.json"
        command = [options.program, "--quiet", "render", scene, "-o", image, "--json", told, "--backend", "cpu", "--spp", str(spp), *how]
        for batch in range(BATCHES):
            left = options.limit - (time.monotonic() - start)
            try:
                done = subprocess.run([*map(str, command), "--seed", str(batch + 1)], capture_output=True, text=True, timeout=max(left, 0.1), check=False,
                                      preexec_fn=lambda: os.sched_setaffinity(0, {core}))
            except subprocess.TimeoutExpired:
                return not_finished(options.limit)
            if done.returncode != 0:
                return failed(done)
            counts = json.loads(told.read_text())["invalid"]
            invalid += sum(counts.get(kind, 0) for kind in ("nan", "inf", "negative"))
            means, bad = box_means(OpenEXR.File(str(image)).channels()["RGB"].pixels, boxes_x, boxes_y)
            values += means
            invalid += bad
    return measured(boxes_x, boxes_y, spp * BATCHES, width * height, time.monotonic() - start, invalid, values)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path, help="the other Ambilux")
    parser.add_argument("scenes", type=Path, help="folder of the exported scenes")
    parser.add_argument("output", type=Path, help="table to write or to go on with")
    parser.add_argument("--method", nargs="+", default=list(METHODS), choices=METHODS, help="default: all")
    parser.add_argument("--paths", type=float, default=2.6e5, help="samples of all pixels and batches (default: %(default)g)")
    parser.add_argument("--limit", type=float, default=60, help="seconds that all batches of a scene may take (default: %(default)g)")
    parser.add_argument("--jobs", type=int, default=1, help="scenes rendered side by side, each on a core of its own")
    options = parser.parse_args()
    table = Table(options.scenes, options.output, options.method)
    cores = queue.SimpleQueue()
    for core in sorted(os.sched_getaffinity(0))[: options.jobs]:
        cores.put(core)

    def one(job):
        core = cores.get()
        try:
            return render(options, options.scenes / f"{job[0]['cell']}.xml", METHODS[job[1]], core)
        finally:
            cores.put(core)

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        running = {pool.submit(one, job): job for job in table.jobs}
        try:
            for i, finished in enumerate(concurrent.futures.as_completed(running)):
                cell, method = running[finished]
                table.add(cell["cell"], method, "cpu", finished.result())
                print(f"{i + 1} of {len(table.jobs)}: {cell['cell']} {method}", file=sys.stderr)
        finally:
            pool.shutdown(cancel_futures=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
