"""Runs claims, their experiments and benches, into one folder. What was done stays, what was interrupted goes on.

Needs Python's standard library and the program.
"""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ambilux.analysis.claims import registry

NOTHING = {"state": "not run", "message": "", "seconds": 0, "small": False, "device": False, "version": "",
           "commands": []}


class Failed(Exception):
    """A command that did not end well, with what it said last."""


@dataclass(frozen=True)
class Place:
    program: tuple
    out: Path
    small: bool
    caller: Callable = None  # of a command, in place of `called`

    def call(self, *arguments):
        return (self.caller or called)([*self.program, *map(str, arguments)])


def called(command):
    """Standard output."""
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as e:
        raise Failed(f"{command[0]}: {e.strerror}") from None
    if done.returncode:
        raise Failed((done.stderr.strip().splitlines() or [f"{command[0]} ended with {done.returncode}"])[-1])
    return done.stdout


def devices(place):
    """What the program says of devices and of itself."""
    return json.loads(place.call("--quiet", "devices", "--json", "-"))


def has_device(place):
    return any(not d["problem"] for d in devices(place)["devices"])


def status_file(out, claim):
    return out / f"{claim.name}.json"


def results(out, claim):
    """Folder of the claim's experiment; claims of one experiment share it."""
    return out / claim.experiment.stem


def bench_file(out, scene, run, turn):
    """Of one bench; claims with the same scene and arguments share it."""
    name = re.sub(r"[^\w.]+", "-", "_".join([scene, *run.arguments]))
    return out / "bench" / f"{name}_{turn}.json"


def experiment_arguments(claim, place):
    arguments = ["experiment", os.path.relpath(claim.experiment), "-o", os.path.relpath(results(place.out, claim)),
                 "--references", os.path.relpath(place.out / "references")]
    return arguments + ["--reduced"] * place.small


def run_experiment(claim, place):
    """What is complete stays; a configuration that has changed since is refused."""
    begun = (results(place.out, claim) / "config.resolved.toml").is_file()
    place.call("--quiet", *experiment_arguments(claim, place), *["--resume"] * begun)


def benches(claim, place):
    """(file, arguments of the program), turn by turn."""
    different = {run.arguments: run for run in claim.bench.runs.values()}.values()
    for turn in range(1, claim.bench.turns + 1):
        for scene in claim.bench.scenes:
            if path := registry.scene_path(claim, scene):
                for run in different:
                    arguments = ["bench", "rays", os.path.relpath(path), *run.arguments]
                    yield bench_file(place.out, scene, run, turn), arguments


def run_benches(claim, place):
    for file, arguments in benches(claim, place):
        if not file.is_file():
            file.parent.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(".part")
            part.write_text(place.call(*arguments, "--json", "-"))
            part.replace(file)


def dry_run(claim, place):
    if claim.experiment:
        place.call("experiment", claim.experiment, "--reduced", "--dry-run")
        return
    for scene in claim.bench.scenes:
        if path := registry.scene_path(claim, scene):
            place.call("info", path)


def commands(claim, place):
    """What a reader types."""
    made = [" ".join(("python3", *claim.make))] if claim.make else []
    asked = [a for _, a in benches(claim, place)] if claim.bench else [experiment_arguments(claim, place)]
    return made + list(dict.fromkeys(" ".join(("ambilux", *a)) for a in asked))


def run(claim, place, device):
    """Runs a claim. Writes and returns its status: the keys of NOTHING; state: "run", "dry run" or "failed"."""
    start, dry, message = time.monotonic(), claim.device and not device, ""
    try:
        if claim.make and not Path(claim.make[-1]).is_file():
            called([sys.executable, *claim.make])
        (dry_run if dry else run_experiment if claim.experiment else run_benches)(claim, place)
    except Failed as e:
        message = str(e)
    status = {"state": "failed" if message else "dry run" if dry else "run", "message": message,
              "seconds": round(time.monotonic() - start, 1), "small": place.small, "device": device,
              "version": place.call("--version").splitlines()[0], "commands": commands(claim, place)}
    status_file(place.out, claim).write_text(json.dumps(status, indent=1) + "\n")
    return status


def status(out, claim):
    file = status_file(out, claim)
    return json.loads(file.read_text()) if file.is_file() else NOTHING
