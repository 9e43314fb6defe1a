#!/usr/bin/env python3
"""Renders the scenes of `ambilux stress --export DIR` with Mitsuba 3 and writes what `ambilux stress --judge` reads.

    python -m venv mitsuba-venv && mitsuba-venv/bin/pip install mitsuba numpy
    ambilux stress --export scenes
    mitsuba-venv/bin/python scripts/stress_mitsuba.py scenes mitsuba.csv
    ambilux stress --judge mitsuba.csv -o mitsuba

Each scene is rendered by a process of its own, so that one that crashes or hangs is a row with a note. Lines that are there already are not made again.
"""

import argparse
import csv
import os
import subprocess
import sys
import time
import xml.etree.ElementTree as xml
from pathlib import Path

HEADER = ["cell", "method", "backend", "boxes_x", "boxes_y", "samples", "pixels", "seconds", "invalid", "state", "note", "boxes"]
METHODS = ("path", "ptracer")
BATCHES, BOXES = 32, 4  # as in experiments/stress/measure.h
RESULT = "result: "  # after whatever Mitsuba prints


def box_means(image, boxes_x, boxes_y):
    """Means over pixels and channels of the boxes of an image, and how many values were no numbers or negative, and count as 0."""
    import numpy as np

    height, width = image.shape[:2]
    bad = ~np.isfinite(image) | (image < 0)
    image = np.where(bad, 0, image).astype(np.float64)
    # Pixel x lies in box x * boxes // width.
    columns = [-(-i * width // boxes_x) for i in range(boxes_x + 1)]
    rows = [-(-i * height // boxes_y) for i in range(boxes_y + 1)]
    means = [image[rows[j]:rows[j + 1], columns[i]:columns[i + 1]].mean() for j in range(boxes_y) for i in range(boxes_x)]
    return means, int(bad.sum())


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
    return [boxes_x, boxes_y, spp * BATCHES, width * height, f"{time.monotonic() - start:.3f}", invalid, "", "", " ".join(f"{v:.9g}" for v in values)]


def nothing(state, note):
    clean = " ".join(note.replace(",", ";").replace('"', "'").split())
    return [1, 1, 0, 1, 0, 0, state, clean[:300] or "no message", ""]


def in_own_process(options, path, method):
    command = [sys.executable, __file__, str(path), "-", "--one", method, "--variant", options.variant, "--paths", str(options.paths)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=options.limit, check=False)
    except subprocess.TimeoutExpired:
        return nothing("left out", f"not finished in {options.limit:g} s")
    if done.returncode != 0:
        lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
        return nothing("refused", f"exit status {done.returncode}: {lines[-1] if lines else ''}")
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
    with open(options.scenes / "expected.csv", encoding="utf-8") as file:
        cells = list(csv.DictReader(file))
    done = set()
    if options.output.exists():
        with open(options.output, encoding="utf-8") as file:
            done = {(row["cell"], row["method"]) for row in csv.DictReader(file)}
    else:
        options.output.write_text(",".join(HEADER) + "\n", encoding="utf-8")
    jobs = [(cell, method) for cell in cells for method in METHODS if (cell["cell"], method) not in done]
    for i, (cell, method) in enumerate(jobs):
        print(f"{i + 1} of {len(jobs)}: {cell['cell']} {method}", file=sys.stderr)
        why = cell["not_mitsuba"]
        line = nothing("left out", why) if why else in_own_process(options, options.scenes / f"{cell['cell']}.xml", method)
        with open(options.output, "a", encoding="utf-8") as file:
            file.write(",".join([cell["cell"], method, "mitsuba", *map(str, line)]) + "\n")
            file.flush()
            os.fsync(file.fileno())
    return 0


if __name__ == "__main__":
    sys.exit(main())
