"""Claims as their files state them: every NAME.claim.toml of a folder (docs/extending.md, "A claim of a paper").

Needs Python's standard library alone. What is wrong with a file is an InputError that names the file and the key.
"""

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

from ambilux.analysis.experiment import InputError, settings_of

ENDING = ".claim.toml"
PROJECT = Path("experiments/claims")
MEASURES = ("at equal time", "at equal samples", "of rates")
KINDS = [f"{form} {measure}" for form in ("ratio", "ranking") for measure in MEASURES]
ERRORS = ("mse", "rmse")  # what a ratio of errors is of: the metric of the experiment, or the root of it
NUMBER, RANGE = (int, float), (int, float, list)
NAMES = {str: "a text", list: "a list", dict: "a table", bool: "true or false", int: "a whole number",
         NUMBER: "a number", RANGE: "a number, or the two ends of a range"}
REQUIRED = {"title": str, "paper": str, "where": str, "states": str, "kind": str, "differs": list, "compare": list}
OPTIONAL = {"doi": str, "error": str, "experiment": str, "bench": dict, "device": bool, "picture": str, "make": list}


@dataclass(frozen=True)
class Compare:
    """`run` over `over` on a scene: how many times as good. published: ends of the range that the paper states, None
    for a ranking. above: what the ratio must exceed. batch: of rays, of a bench."""

    scene: str
    run: str
    over: str
    published: tuple | None = None
    above: float = 1.0
    batch: str = ""


@dataclass(frozen=True)
class BenchRun:
    """`ambilux bench rays SCENE arguments`. kernel: of the rows of a batch; empty: the first, which renders use."""

    arguments: tuple
    kernel: str = ""


@dataclass(frozen=True)
class Bench:
    turns: int
    scenes: dict  # {name: path}
    runs: dict    # {name: BenchRun}


@dataclass(frozen=True)
class Claim:
    name: str
    file: Path
    title: str
    paper: str
    doi: str
    where: str     # figure, table or section of the paper
    states: str    # what the paper claims, in one sentence
    kind: str      # one of KINDS
    error: str     # one of ERRORS
    experiment: Path | None
    bench: Bench | None
    compares: tuple
    differs: tuple  # from the paper: scene, device, roulette, next events
    device: bool    # says nothing without a device
    picture: str    # scene whose images stand side by side, or empty
    make: tuple     # Python script and arguments that write a scene; the last one is the file

    @property
    def measure(self):
        return self.kind.partition(" ")[2]


def fields_of(place, table, required, optional):
    """The table; a key that is missing, unknown or of another type is refused by name."""
    if not isinstance(table, dict):
        raise InputError(f"{place}: must be a table")
    known = {**required, **optional}
    for key, value in table.items():
        if key not in known:
            raise InputError(f"{place}: unknown key '{key}'; there are {', '.join(known)}")
        if not isinstance(value, known[key]):
            raise InputError(f"{place}: '{key}' must be {NAMES[known[key]]}")
    if missing := [key for key in required if key not in table]:
        raise InputError(f"{place}: lacks the key '{missing[0]}'")
    return table


def one_of(place, key, value, known):
    if value not in known:
        raise InputError(f"{place}: {key} '{value}' is none of {', '.join(known)}")
    return value


def texts(place, key, values):
    if not values or not all(isinstance(v, str) and v for v in values):
        raise InputError(f"{place}: '{key}' must list texts")
    return tuple(values)


def compare_of(place, table, kind):
    required, optional = {"scene": str, "run": str, "over": str}, {"published": RANGE, "above": NUMBER, "batch": str}
    published = fields_of(place, table, required, optional).get("published")
    if (published is not None) != kind.startswith("ratio"):
        raise InputError(f"{place}: a ratio has 'published', a ranking has none")
    if published is None:
        return Compare(**table)
    ends = published if isinstance(published, list) else [published, published]
    if len(ends) != 2 or not all(isinstance(e, NUMBER) for e in ends) or not 0 < ends[0] <= ends[1]:
        raise InputError(f"{place}: 'published' must be a positive number, or the two ends of a range")
    return Compare(**{**table, "published": tuple(ends)})


def bench_of(place, table):
    fields_of(place, table, {"turns": int, "scenes": dict, "runs": dict}, {})
    runs = {}
    for name, run in table["runs"].items():
        fields_of(f"{place} run '{name}'", run, {"arguments": list}, {"kernel": str})
        runs[name] = BenchRun(texts(place, "arguments", run["arguments"]), run.get("kernel", ""))
    texts(place, "scenes", list(table["scenes"].values()))
    return Bench(table["turns"], table["scenes"], runs)


def names_in(path):
    """(scenes, runs) that an experiment's configuration names, those of sweeps by their base."""
    try:
        config = tomllib.loads(path.read_text(encoding="utf-8"))
        return [[entry["name"] for entry in config[key]] for key in ("scene", "run")]
    except OSError as e:
        raise InputError(f"{path}: cannot be read: {e.strerror}") from None
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as e:
        raise InputError(f"{path}: is no configuration of an experiment: {e}") from None


def check_names(claim):
    """Refuses scenes and runs that the experiment or the bench does not have."""
    bench = claim.bench
    scenes, runs = (list(bench.scenes), list(bench.runs)) if bench else names_in(claim.experiment)
    for c in claim.compares:
        one_of(claim.file, "scene", c.scene, scenes)
        for run in (c.run, c.over):
            one_of(claim.file, "run", settings_of(run)[0], runs)
        if bool(c.batch) != bool(bench):
            raise InputError(f"{claim.file}: 'batch' names rays of a bench, and belongs to one")
    if claim.picture:
        one_of(claim.file, "picture", claim.picture, scenes)


def read(file):
    """The Claim of one file."""
    try:
        table = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, OSError, UnicodeDecodeError) as e:
        raise InputError(f"{file}: {e}") from None
    fields_of(file, table, REQUIRED, OPTIONAL)
    name, kind = file.name.removesuffix(ENDING), one_of(file, "kind", table["kind"], KINDS)
    if "bench" in table and ("experiment" in table or not kind.endswith("of rates")):
        raise InputError(f"{file}: a bench is of rates, and has no experiment")
    bench = bench_of(f"{file}: [bench]", table["bench"]) if "bench" in table else None
    claim = Claim(
        name, file, table["title"], table["paper"], table.get("doi", ""), table["where"], table["states"], kind,
        one_of(file, "error", table.get("error", "mse"), ERRORS),
        None if bench else file.parent / table.get("experiment", f"{name}.toml"), bench,
        tuple(compare_of(f"{file}: [[compare]] {i}", c, kind) for i, c in enumerate(table["compare"], 1)),
        texts(file, "differs", table["differs"]), table.get("device", False), table.get("picture", ""),
        texts(file, "make", table["make"]) if "make" in table else ())
    if not claim.compares:
        raise InputError(f"{file}: compares nothing")
    check_names(claim)
    return claim


def load(folder, only=()):
    """The claims of a folder by name; of `only` those alone."""
    claims = {claim.name: claim for claim in map(read, sorted(Path(folder).glob(f"*{ENDING}")))}
    if not claims:
        raise InputError(f"{folder}: holds no NAME{ENDING}")
    for name in only:
        one_of(folder, "claim", name, claims)
    return [claim for claim in claims.values() if not only or claim.name in only]


def scene_path(claim, name):
    """Of a scene of the claim's bench; None where it is not there, such as one of AMBILUX_DATA."""
    path = os.path.expandvars(claim.bench.scenes[name])
    place = claim.file.parent / path
    return place if "$" not in path and place.is_file() else None
