"""The table that `ambilux stress --judge` reads: what another renderer measured on the scenes of `ambilux stress --export`."""

import csv
import os

HEADER = ["cell", "method", "backend", "boxes_x", "boxes_y", "samples", "pixels", "seconds", "invalid", "state", "note", "boxes"]
BATCHES, BOXES = 32, 4  # as in stress/measure.h


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


def nothing(state, note):
    clean = " ".join(note.replace(",", ";").replace('"', "'").split())
    return [1, 1, 0, 1, 0, 0, state, clean[:300] or "no message", ""]


def failed(done):
    """The columns for a process that ended with an error."""
    lines = [line for line in (done.stderr + done.stdout).splitlines() if line.strip()]
    return nothing("refused", f"exit status {done.returncode}: {lines[-1] if lines else ''}")


def not_finished(limit):
    return nothing("left out", f"not finished in {limit:g} s")


def measured(boxes_x, boxes_y, samples, pixels, seconds, invalid, values):
    return [boxes_x, boxes_y, samples, pixels, f"{seconds:.3f}", invalid, "", "", " ".join(f"{v:.9g}" for v in values)]


class Table:
    """Lines that are there already are not made again."""

    def __init__(self, scenes, path, methods):
        self.path, done = path, set()
        with open(scenes / "expected.csv", encoding="utf-8") as file:
            cells = list(csv.DictReader(file))
        if path.exists():
            with open(path, encoding="utf-8") as file:
                done = {(row["cell"], row["method"]) for row in csv.DictReader(file)}
        else:
            path.write_text(",".join(HEADER) + "\n", encoding="utf-8")
        self.jobs = [(cell, method) for cell in cells for method in methods if (cell["cell"], method) not in done]

    def add(self, cell, method, renderer, columns):
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(",".join([cell, method, renderer, *map(str, columns)]) + "\n")
            file.flush()
            os.fsync(file.fileno())
