#!/usr/bin/env python3
"""Renders the scenes of `ambilux stress --export DIR` with Mitsuba 3 and writes what `ambilux stress --judge` reads.

    python -m venv mitsuba-venv && mitsuba-venv/bin/pip install mitsuba numpy
    ambilux stress --export scenes
    mitsuba-venv/bin/python scripts/peers/stress_mitsuba.py scenes mitsuba.csv
    ambilux stress --judge mitsuba.csv -o mitsuba

Each scene is rendered by a process of its own, so that one that crashes or hangs is a row with a note. Lines that are there already are not made again.
"""

import argparse
import subprocess
import sys
import time
import xml.etree.ElementTree as xml
from pathlib import Path

from stress_table import BATCHES, BOXES, Table, box_means, failed, measured, not_finished, nothing

METHODS = ("path", "ptracer")
RESULT = "result: "  # after whatever Mitsuba prints


def render(path, method, variant, paths):
    """The columns of a line behind `backend`."""
    import mitsuba as mi
    import numpy as np

    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    start = time.monotonic()
    scene = mi.load_file(str(path))
    integrator = scene.integrator()
    if method != "path":
        depths = {e.get("name"): int(e.get("value")) for e in xml.parse(path).getroot().find("integrator")}
        integrator = mi.load_dict({"type": method, **depths})
    width, height = (int(n) for n in scene.sensors()[0].film().crop_size())
    spp = max(1, round(paths / (BATCHES * width * height)))
    boxes_x, boxes_y = min(BOXES, width), min(BOXES, height)
    values, invalid = [], 0
    for batch in range(BATCHES):
        image = np.array(mi.render(scene, integrator=integrator, seed=batch, spp=spp))[:, :, :3]
        means, bad = box_means(image, boxes_x, boxes_y)
        values += means
        invalid += bad
    return measured(boxes_x, boxes_y, spp * BATCHES, width * height, time.monotonic() - start, invalid, values)


def in_own_process(options, path, method):
    command = [sys.executable, __file__, str(path), "-", "--one", method, "--variant", options.variant, "--paths", str(options.paths)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=options.limit, check=False)
    except subprocess.TimeoutExpired:
        return not_finished(options.limit)
    if done.returncode != 0:
        return failed(done)
    return done.stdout.rpartition(RESULT)[2].strip().split(",")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, help="folder of the exported scenes")
    parser.add_argument("output", type=Path, help="table to write or to go on with")
    parser.add_argument("--variant", default="scalar_rgb", help="of Mitsuba (default: %(default)s)")
    parser.add_argument("--paths", type=float, default=2.6e5, help="samples of all pixels and batches (default: %(default)g)")
    parser.add_argument("--limit", type=float, default=90, help="seconds that a scene may take (default: %(default)g)")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(RESULT + ",".join(str(x) for x in render(options.scenes, options.one, options.variant, options.paths)))
        return 0
    table = Table(options.scenes, options.output, METHODS)
    for i, (cell, method) in enumerate(table.jobs):
        print(f"{i + 1} of {len(table.jobs)}: {cell['cell']} {method}", file=sys.stderr)
        why = cell["not_mitsuba"]
        table.add(cell["cell"], method, "mitsuba", nothing("left out", why) if why else in_own_process(options, options.scenes / f"{cell['cell']}.xml", method))
    return 0


if __name__ == "__main__":
    sys.exit(main())
