"""Reads the folder of an experiment: manifest.json, config.resolved.toml, runs.csv, images, statistics, techniques.

What is wrong with a file is an InputError that names file, line and column or key.
"""

import csv
import json
import math
import re
import tomllib
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path

TEXT = ("scene", "run", "budget", "method", "stated_bias")
KINDS = ("spp", "seconds", "")  # of checkpoints; the last one: not recorded
INTEGERS = ("seed", "checkpoint", "batch", "spp", "rays", "invalid")
FORMAT = 2  # of the folder, as its manifest states it; folders without a number are of format 1 and are read too
METRICS = ("relmse", "mse")  # what `metric` of a configuration can name


class InputError(Exception):
    """What is wrong with an experiment folder, with file, line and column where there is one."""


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
    bias: float  # mean(x - r)
    bias_z: float
    rays: int
    invalid: int  # values dropped: NaN, Inf, negative
    # Of newer runners. budget: which kind of checkpoint the row is, "spp" or "seconds".
    budget: str = ""
    relmse_trimmed: float = math.nan  # relMSE without the worst `trimmed_share` of the pixels
    relmse_trimmed_corrected: float = math.nan
    method: str = ""  # what ran: integrator, variant and settings, those that bdpt.auto chose included
    stated_bias: str = ""  # what the method says of its bias; empty: it has none

    @property
    def error(self):
        """RMSE against the truth where the reference states its noise, else RMSE against the reference."""
        return self.rmse if math.isnan(self.rmse_corrected) else self.rmse_corrected

    @property
    def relative_error(self):
        """relMSE, chosen like `error`."""
        return self.relmse if math.isnan(self.relmse_corrected) else self.relmse_corrected

    @property
    def trimmed_error(self):
        """relMSE without its worst pixels, chosen like `error`; NaN if it was not recorded."""
        return self.relmse_trimmed if math.isnan(self.relmse_trimmed_corrected) else self.relmse_trimmed_corrected


    @property
    def mse(self):
        return self.error**2


@dataclass(frozen=True)
class Batch:
    """Whole passes of one render, apart from its others: independent samples of one method. Errors are of the batch's own image, corrected for the
    reference's noise where that is known."""

    scene: str
    run: str
    seed: int
    batch: int
    spp: int
    time: float
    mse: float
    relmse: float
    other_cores: float = math.nan  # that other processes held meanwhile


def columns(kind, optional):
    """Names of the fields of a dataclass with or without a default."""
    return tuple(f.name for f in fields(kind) if (f.default is MISSING) != optional)


@dataclass
class Experiment:
    folder: Path
    manifest: dict
    rows: list
    scenes: list  # names in the order of the configuration
    runs: list
    base: str  # the run that others are compared with: `default` of [ablation] in the configuration, else the first
    metric: str = "relmse"  # the error that leads: `metric` of the configuration
    batches: list = field(default_factory=list)
    kept: dict = field(default_factory=dict)  # what was made of them, for use by several figures

    @property
    def name(self):
        return str(self.manifest.get("name", self.folder.name))

    @property
    def others(self):
        return [run for run in self.runs if run != self.base]

    def scene_entry(self, scene):
        return next(s for s in self.manifest["scenes"] if s["name"] == scene)

    def pixels(self, scene):
        """Number of pixels of the scene's images as the manifest states it; NaN without."""
        size = self.scene_entry(scene).get("size")
        return size[0] * size[1] if size else math.nan

    def __post_init__(self):
        self._of_run = {}
        for r in sorted(self.rows, key=lambda r: (r.seed, r.checkpoint)):
            self._of_run.setdefault((r.scene, r.run), []).append(r)
        self._batches = {}
        for b in sorted(self.batches, key=lambda b: (b.seed, b.batch)):
            self._batches.setdefault((b.scene, b.run), {}).setdefault(b.seed, []).append(b)
        self.budgets = {r.budget for r in self.rows}

    def budget(self, kind):
        """The kind of checkpoints that stand for `kind`, "spp" or "seconds": itself if the experiment has both kinds, None (all rows) if it has one.

        Checkpoints of either kind rise within a render, but those of both together do not: a fast run passes its last one in samples
        before its first one in seconds, a slow one in between."""
        return kind if {"spp", "seconds"} <= self.budgets else None

    def select(self, scene, run, checkpoint=None, budget=None):
        """Rows of one run in one scene, by seed and checkpoint; of one kind of checkpoints if `budget` names it."""
        return [r for r in self._of_run.get((scene, run), ()) if checkpoint in (None, r.checkpoint) and budget in (None, r.budget)]

    def batches_of(self, scene, run):
        """{seed: its batches in order}."""
        return self._batches.get((scene, run), {})

    def methods(self, scene, run):
        """{what ran: seeds}, of the runs that say it. More than one where bdpt.auto chose differently."""
        out = {}
        for r in self.select(scene, run):
            if r.method:
                out.setdefault(r.method, set()).add(r.seed)
        return {method: sorted(seeds) for method, seeds in out.items()}

    def seeds(self, scene, run):
        return sorted({r.seed for r in self.select(scene, run)})

    def checkpoints(self, scene, run, budget=None):
        return sorted({r.checkpoint for r in self.select(scene, run, budget=budget)})

    def last_common_checkpoint(self, scene):
        """The last checkpoint (in seconds, if there are any) that every run of the scene has reached with at least one seed; None without one."""
        sets = [set(self.checkpoints(scene, run, self.budget("seconds"))) for run in self.runs if self.select(scene, run)]
        common = set.intersection(*sets) if sets else set()
        return max(common) if common else None

    def files(self, folder, scene, run, suffix):
        """(seed, path) of all folder/SCENE/RUN_SEED.suffix, by seed. One run's name may begin with another's."""
        pattern = re.compile(re.escape(run) + r"_(\d+)" + re.escape(suffix))
        place = self.folder / folder / scene
        return sorted((int(m[1]), p) for p in (place.iterdir() if place.is_dir() else ()) if (m := pattern.fullmatch(p.name)))

    def image(self, scene, run):
        """(seed, path) of the image of the lowest seed, or None."""
        return next(iter(self.files("images", scene, run, ".exr")), None)

    def reference(self, scene):
        """Path of the reference image as the manifest names it, relative to the folder or absolute; where results came from another machine, the file of
        that name in references/ here or beside the folder (names hold a hash of all that decides the image). None if it is not there."""
        name = (self.scene_entry(scene).get("reference") or {}).get("file")
        places = [self.folder / name, *(place / "references" / Path(name).name for place in (self.folder, self.folder.resolve().parent))] if name else ()
        return next((place for place in places if place.is_file()), None)

    def stats(self, scene, run):
        """Statistics of the renders of all seeds, as the runner wrote them."""
        return list(self.stats_by_seed(scene, run).values())

    def stats_by_seed(self, scene, run):
        """{seed: statistics}."""
        return {seed: read_json(path) for seed, path in self.files("stats", scene, run, ".json")}

    def techniques(self, scene, run):
        """(seed, folder) of all folders techniques/SCENE/RUN_SEED that hold a techniques.json."""
        return [(seed, p) for seed, p in self.files("techniques", scene, run, "") if (p / "techniques.json").is_file()]


def settings_of(run):
    """("lvc", {"connections": "4"}) of the run name "lvc[connections=4]", as the runner names the runs of a sweep; (name, {}) of others."""
    match = re.fullmatch(r"([^\[\]]+)\[([^\[\]]+)\]", run)
    pairs = [part.partition("=") for part in re.split(r"[,;]\s*", match[2])] if match else []
    return (match[1], {key.strip(): value.strip() for key, _, value in pairs}) if pairs and all(equals for _, equals, _ in pairs) else (run, {})


def read_json(path):
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as e:
        raise InputError(f"{path}:{e.lineno}: column {e.colno}: {e.msg}; the file may be half-written") from None
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"{path}: cannot be read: {e}") from None


def parse_number(text, column, place):
    """Number of one cell; "nan" and "inf" are numbers where the column's values are real."""
    try:
        return int(text) if column in INTEGERS else float(text)
    except ValueError:
        raise InputError(f"{place}: column '{column}' holds '{text}', which is no number") from None


def read_table(path, kind, key, scenes, runs):
    """Reads a table of rows `kind`. Further columns are ignored; a missing one, a bad number, a repeated `key` or an unknown name is an InputError."""
    rows, seen = [], {}
    try:
        content = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"{path}: cannot be read: {e}") from None
    reader = csv.DictReader(content.splitlines(keepends=True))
    required = columns(kind, False)
    missing = [c for c in required if c not in (reader.fieldnames or ())]
    if missing:
        raise InputError(f"{path}:1: lacks the column{'s' if len(missing) > 1 else ''} {', '.join(missing)}")
    known_columns = [*required, *(c for c in columns(kind, True) if c in reader.fieldnames)]
    for record in reader:
        place = f"{path}:{reader.line_num}"
        cells = sum(v is not None for k, v in record.items() if k is not None) + len(record.get(None) or ())
        whole = len(reader.fieldnames)
        if cells > whole:
            raise InputError(f"{place}: {cells} cells where the header names {whole}; the last one named is column '{reader.fieldnames[-1]}'")
        if cells < whole:
            raise InputError(f"{place}: ends in column '{reader.fieldnames[cells - 1]}', {cells} cells where the header names {whole}: a half-written row. "
                             "`ambilux experiment ... --resume` completes it; without that line the rest can be analysed")
        row = kind(**{c: record[c] if c in TEXT else parse_number(record[c], c, place) for c in known_columns})
        if getattr(row, "budget", "") not in KINDS:
            raise InputError(f"{place}: column 'budget' holds '{row.budget}', which is neither 'spp' nor 'seconds'")
        for column, name, known in (("scene", row.scene, scenes), ("run", row.run, runs)):
            if name not in known:
                raise InputError(f"{place}: column '{column}': {column} '{name}' is not in manifest.json")
        for column in ("spp", "time"):
            if not getattr(row, column) > 0:
                raise InputError(f"{place}: column '{column}' holds '{record[column]}', which must be positive")
        own = tuple(getattr(row, c) for c in key)
        if own in seen:
            raise InputError(f"{place}: repeats line {seen[own]} ({', '.join(f'{c} {v}' for c, v in zip(key, own))})")
        seen[own] = reader.line_num
        rows.append(row)
    if rows and not content.endswith("\n"):
        raise InputError(f"{path}:{reader.line_num}: column '{reader.fieldnames[-1]}': the line does not end: a half-written row. "
                         "`ambilux experiment ... --resume` completes it")
    return rows


def read_rows(path, scenes, runs):
    """Reads runs.csv."""
    rows = read_table(path, Row, ("scene", "run", "seed", "checkpoint"), scenes, runs)
    if not rows:
        raise InputError(f"{path}: holds no results yet")
    return rows


def read_config(path, runs):
    """(run that others are compared with, metric that leads) of the resolved configuration: `default` of [ablation], else the first run; `metric`, else relmse."""
    if not path.is_file():
        return runs[0], METRICS[0]
    try:
        config = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, OSError, UnicodeDecodeError) as e:
        raise InputError(f"{path}: {e}") from None
    base, metric = (config.get("ablation") or {}).get("default", runs[0]), config.get("metric", METRICS[0])
    if base not in runs:
        raise InputError(f"{path}: [ablation] default = '{base}' is not a run of manifest.json")
    if metric not in METRICS:
        raise InputError(f"{path}: metric = '{metric}' is neither {' nor '.join(METRICS)}")
    return base, metric


def load(folder):
    """Reads an experiment folder. Throws InputError."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder")
    for name in ("manifest.json", "runs.csv"):
        if not (folder / name).is_file():
            empty = "is empty: " if not any(folder.iterdir()) else "is no experiment folder: "
            raise InputError(f"{folder}: {empty}it has no {name}")
    manifest = read_json(folder / "manifest.json")
    try:
        scenes, runs = ([entry["name"] for entry in manifest[key]] for key in ("scenes", "runs"))
    except (KeyError, TypeError):
        raise InputError(f"{folder / 'manifest.json'}: lacks the lists 'scenes' and 'runs' of objects with a 'name'") from None
    if not scenes or not runs:
        raise InputError(f"{folder / 'manifest.json'}: the list '{'runs' if scenes else 'scenes'}' is empty")
    version = manifest.get("format", 1)
    if version not in range(1, FORMAT + 1):
        raise InputError(f"{folder / 'manifest.json'}: 'format' is {version}; this version reads formats 1 to {FORMAT}")
    rows = read_rows(folder / "runs.csv", scenes, runs)
    path = folder / "batches.csv"
    batches = read_table(path, Batch, ("scene", "run", "seed", "batch"), scenes, runs) if path.is_file() else []
    return Experiment(folder, manifest, rows, scenes, runs, *read_config(folder / "config.resolved.toml", runs), batches)
