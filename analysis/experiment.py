"""Reads the folder of an experiment: manifest.json, runs.csv, images."""

import csv
import json
import math
import re
from dataclasses import dataclass, field
from pathlib import Path

REQUIRED = ("scene", "run", "seed", "checkpoint", "spp", "seconds", "rmse", "rmse_corrected", "relmse", "mape", "rays", "nan", "inf", "negative")
TEXT = ("scene", "run")
INTEGERS = ("seed", "checkpoint", "spp", "rays", "nan", "inf", "negative")


class InputError(Exception):
    """What is wrong with an experiment folder, with file and line."""


@dataclass(frozen=True)
class Row:
    """One checkpoint of one seed of one run, as recorded. Seconds are render time; errors are over all pixels and channels."""

    scene: str
    run: str
    seed: int
    checkpoint: int
    spp: int
    seconds: float
    rmse: float
    rmse_corrected: float  # the reference's own noise subtracted; NaN if unknown
    relmse: float
    mape: float
    rays: int
    nan: int
    inf: int
    negative: int

    @property
    def invalid(self):
        return self.nan + self.inf + self.negative

    @property
    def error(self):
        """RMSE against the truth where the reference states its noise, else RMSE against the reference."""
        return self.rmse if math.isnan(self.rmse_corrected) else self.rmse_corrected

    @property
    def reference_noise(self):
        """The reference's RMS standard error, which the runner subtracted: sqrt(rmse^2 - rmse_corrected^2); NaN if unknown or hidden by max(0, .)."""
        if math.isnan(self.rmse_corrected) or self.rmse_corrected == 0:
            return math.nan
        return math.sqrt(max(0.0, self.rmse**2 - self.rmse_corrected**2))


@dataclass
class Experiment:
    folder: Path
    manifest: dict
    rows: list
    scenes: list = field(default_factory=list)  # names in the order of runs.csv
    runs: list = field(default_factory=list)

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
        pattern = re.compile(re.escape(run) + r"_seed(\d+)\.exr")
        found = [(int(m[1]), p) for p in (self.folder / "images" / scene).glob("*.exr") if (m := pattern.fullmatch(p.name))]
        return min(found)[1] if found else None

    def reference(self, scene):
        """Path of the reference image, or None."""
        places = (f"references/{scene}.exr", f"images/{scene}/reference.exr")
        return next((self.folder / p for p in places if (self.folder / p).is_file()), None)


def parse_number(text, column, place):
    """Number of one cell. An empty cell or "null" is NaN where a value may be unknown."""
    try:
        if column in INTEGERS:
            return int(text)
        return math.nan if text in ("", "null") else float(text)
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
            if row.spp <= 0 or not row.seconds > 0:
                raise InputError(f"{place}: spp and seconds must be positive")
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
    rows = read_rows(folder / "runs.csv")
    unique = lambda values: list(dict.fromkeys(values))
    return Experiment(folder, manifest, rows, unique(r.scene for r in rows), unique(r.run for r in rows))
