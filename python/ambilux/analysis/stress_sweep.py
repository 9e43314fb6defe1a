"""Rows of `ambilux stress`, of a backend or of another renderer: what is read, compared and counted."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from scipy import stats

from ambilux.analysis.experiment import InputError

VERDICTS = ("failed", "invalid", "refused", "limit", "noisy", "ok", "left out")
NUMBERS = ("value", "mean", "standard_error", "dof", "expected", "expected_error", "relative_bias", "z", "box_z", "p", "events", "variance",
           "variance_ratio", "first", "samples", "paths", "invalid", "lost", "underflow", "seconds")
TEXTS = ("cell", "family", "method", "backend", "verdict", "limit", "note")
# Chance that one of all differences between backends is found though none is there: that of five standard deviations.
SIGNIFICANCE = 5.733e-7


@dataclass
class Sweep:
    """Rows of one or more folders. rows: (backend, method, cell) -> dict; columns: (backend, method) in order; families: name -> names of cells, in order."""

    rows: dict
    columns: list
    families: dict

    def count(self, verdict, backend=None, family=None):
        return sum(r["verdict"] == verdict and backend in (None, r["backend"]) and family in (None, r["family"]) for r in self.rows.values())

    @property
    def backends(self):
        return list(dict.fromkeys(b for b, _ in self.columns))


def read_row(record, place):
    row = {name: record[name] for name in TEXTS}
    for name in NUMBERS:
        try:
            row[name] = float(record[name])
        except ValueError:
            raise InputError(f"{place}: column '{name}' holds '{record[name]}', which is no number") from None
    if row["verdict"] not in VERDICTS:
        raise InputError(f"{place}: column 'verdict' holds '{row['verdict']}'; known are {', '.join(VERDICTS)}")
    return row


def load(folders):
    """Reads stress.csv of all folders. Throws InputError."""
    rows = {}
    for folder in folders:
        path = Path(folder) / "stress.csv"
        try:
            content = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as e:
            raise InputError(f"{path}: cannot be read: {e}") from None
        reader = csv.DictReader(content.splitlines())
        missing = [c for c in TEXTS + NUMBERS if c not in (reader.fieldnames or ())]
        if missing:
            raise InputError(f"{path}:1: lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
        for record in reader:
            place = f"{path}:{reader.line_num}"
            if None in record or None in record.values():
                raise InputError(f"{place}: not as many cells as the header names: a half-written row; `ambilux stress --resume` completes it")
            row = read_row(record, place)
            key = (row["backend"], row["method"], row["cell"])
            if key in rows:
                raise InputError(f"{place}: {row['cell']} by {row['method']} on {row['backend']} is there twice")
            rows[key] = row
    if not rows:
        raise InputError(f"{', '.join(str(f) for f in folders)}: no rows yet")
    families = {}
    for row in rows.values():
        cells = families.setdefault(row["family"], [])
        if row["cell"] not in cells:
            cells.append(row["cell"])
    values = {row["cell"]: row["value"] for row in rows.values()}
    for cells in families.values():
        cells.sort(key=lambda cell: values[cell])
    return Sweep(rows, list(dict.fromkeys((b, m) for b, m, _ in rows)), families)


def measured(row):
    return row["samples"] > 0


def backend_differences(sweep):
    """Rows (method, cell, z, p, relative difference at equal samples) of methods that ran on "cpu" and "cuda". Both use the same random numbers, so
    that the errors of the two means, taken as independent, are too large: z is too small, if anything."""
    found = []
    for (backend, method, cell), a in sweep.rows.items():
        b = sweep.rows.get(("cuda", method, cell))
        if backend != "cpu" or b is None or not (measured(a) and measured(b)):
            continue
        difference, variance = a["mean"] - b["mean"], a["standard_error"] ** 2 + b["standard_error"] ** 2
        scale = max(abs(a["mean"]), abs(b["mean"]))
        rounding = 2e-5 * scale
        if abs(difference) <= rounding:
            z, p = 0.0, 1.0
        elif variance + rounding**2 == 0:
            z, p = math.inf, 0.0
        else:
            terms = a["standard_error"] ** 4 / a["dof"] + b["standard_error"] ** 4 / b["dof"]
            z = difference / math.sqrt(variance + rounding**2)
            p = 2 * (stats.t.sf(abs(z), variance**2 / terms) if terms > 0 else stats.norm.sf(abs(z)))
        first = (b["first"] / a["first"] - 1) if a["first"] else 0.0
        found.append((method, cell, z, p, first))
    return found


def disagreeing(differences):
    level = -math.expm1(math.log1p(-SIGNIFICANCE) / max(1, len(differences)))
    return [d for d in differences if d[3] < level]


def limits(sweep):
    """(limit, family, backend, cells with a row that is off, largest |bias| of one) of all limits that rows met."""
    found = {}
    for row in sweep.rows.values():
        if row["verdict"] == "limit":
            cells, worst = found.setdefault((row["limit"], row["family"], row["backend"]), ({}, [0.0]))
            cells[row["cell"]] = row["value"]
            worst[0] = max(worst[0], abs(row["relative_bias"]))
    return [(*key, sorted(cells, key=cells.get), worst[0]) for key, (cells, worst) in found.items()]


def write_tables(sweep, out):
    with open(out / "stress_table.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["family", "backend", "cells", *VERDICTS])
        for family, cells in sweep.families.items():
            for backend in sweep.backends:
                table.writerow([family, backend, len(cells), *(sweep.count(v, backend, family) for v in VERDICTS)])
        for backend in sweep.backends:
            table.writerow(["all", backend, sum(map(len, sweep.families.values())), *(sweep.count(v, backend) for v in VERDICTS)])
    differences = backend_differences(sweep)
    if differences:
        with open(out / "stress_backends.csv", "w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["method", "cell", "z", "p", "relative_difference_at_equal_samples"])
            table.writerows((m, c, f"{z:.4g}", f"{p:.4g}", f"{d:.4g}") for m, c, z, p, d in differences)
