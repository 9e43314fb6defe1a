"""Reads the folder of an experiment: manifest.json, runs.csv, images."""

import csv
import json
import math
import re
from dataclasses import dataclass, fields
from pathlib import Path

TEXT = ("scene", "run")
INTEGERS = ("seed", "checkpoint", "spp", "rays", "invalid")


class InputError(Exception):
    """What is wrong with an experiment folder, with file and line."""


@dataclass(frozen=True)
class Row:
    """One checkpoint of one seed of one run, as recorded. Errors are over all pixels and channels (film/metrics.h); those named
    `_corrected` have the reference's own noise subtracted and are NaN if that is unknown."""

    scene: str
    run: str
    seed: int
    checkpoint: int
    spp: int
    time: float  # seconds inside the renderer, wall clock
    rmse: float
    rmse_corrected: float
    reference_noise: float
    relmse: float
    relmse_corrected: float
    mape: float
    bias_z: float
    rays: int
    invalid: int  # values dropped: NaN, Inf, negative

    @property
    def error(self):
        """RMSE against the truth where the reference states its noise, else RMSE against the reference."""
        return self.rmse if math.isnan(self.rmse_corrected) else self.rmse_corrected

    @property
    def relative_error(self):
        """relMSE, chosen like `error`."""
        return self.relmse if math.isnan(self.relmse_corrected) else self.relmse_corrected


REQUIRED = tuple(f.name for f in fields(Row))


@dataclass
class Experiment:
    folder: Path
    manifest: dict
    rows: list
    scenes: list  # names in the order of the configuration
    runs: list

    def select(self, scene, run, checkpoint=None):
        """Rows of one run in one scene, by seed and checkpoint."""
        rows = [r for r in self.rows if r.scene == scene and r.run == run and checkpoint in (None, r.checkpoint)]
        return sorted(rows, key=lambda r: (r.seed, r.checkpoint))

    def seeds(self, scene, run):
        return sorted({r.seed for r in self.select(scene, run)})

    def checkpoints(self, scene, run):
        return sorted({r.checkpoint for r in self.select(scene, run)})

    def last_common_checkpoint(self, scene):
        """The last checkpoint that every run of the scene has reached with at least one seed; None without one."""
        sets = [set(self.checkpoints(scene, run)) for run in self.runs if self.select(scene, run)]
        common = set.intersection(*sets) if sets else set()
        return max(common) if common else None

    def image(self, scene, run):
        """Path of the image of the lowest seed, or None."""
        pattern = re.compile(re.escape(run) + r"_(\d+)\.exr")
        found = [(int(m[1]), p) for p in (self.folder / "images" / scene).glob("*.exr") if (m := pattern.fullmatch(p.name))]
        return min(found)[1] if found else None

    def reference(self, scene):
        """Path of the reference image as the manifest names it, relative to the folder or absolute; None if it is not there."""
        entry = next(s for s in self.manifest["scenes"] if s["name"] == scene)
        name = (entry.get("reference") or {}).get("file")
        return self.folder / name if name and (self.folder / name).is_file() else None


def parse_number(text, column, place):
    """Number of one cell; "nan" and "inf" are numbers where the column's values are real."""
    try:
        return int(text) if column in INTEGERS else float(text)
    except ValueError:
        raise InputError(f"{place}: column '{column}' holds '{text}', which is no number") from None


def read_rows(path):
    """Reads runs.csv. Further columns are ignored; a missing one, a bad number or a repeated row is an InputError."""
    rows, seen = [], {}
    with open(path, newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        missing = [c for c in REQUIRED if c not in (reader.fieldnames or ())]
        if missing:
            raise InputError(f"{path}:1: lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
        for record in reader:
            place = f"{path}:{reader.line_num}"
            if None in record or any(record[c] is None for c in REQUIRED):
                raise InputError(f"{place}: number of cells differs from the header's")
            row = Row(**{c: record[c] if c in TEXT else parse_number(record[c], c, place) for c in REQUIRED})
            if row.spp <= 0 or not row.time > 0:
                raise InputError(f"{place}: spp and time must be positive")
            key = (row.scene, row.run, row.seed, row.checkpoint)
            if key in seen:
                raise InputError(f"{place}: repeats line {seen[key]} (scene {row.scene}, run {row.run}, seed {row.seed}, checkpoint {row.checkpoint})")
            seen[key] = reader.line_num
            rows.append(row)
    if not rows:
        raise InputError(f"{path}: holds no results yet")
    return rows


def load(folder):
    """Reads an experiment folder. Throws InputError."""
    folder = Path(folder)
    for name in ("manifest.json", "runs.csv"):
        if not (folder / name).is_file():
            raise InputError(f"{folder}: is no experiment folder: it has no {name}")
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except json.JSONDecodeError as e:
        raise InputError(f"{folder / 'manifest.json'}:{e.lineno}: {e.msg}") from None
    try:
        scenes, runs = ([entry["name"] for entry in manifest[key]] for key in ("scenes", "runs"))
    except (KeyError, TypeError):
        raise InputError(f"{folder / 'manifest.json'}: lacks the lists 'scenes' and 'runs' of objects with a 'name'") from None
    rows = read_rows(folder / "runs.csv")
    for row in rows:
        for kind, name, known in (("scene", row.scene, scenes), ("run", row.run, runs)):
            if name not in known:
                raise InputError(f"{folder / 'runs.csv'}: {kind} '{name}' is not in manifest.json")
    return Experiment(folder, manifest, rows, scenes, runs)
