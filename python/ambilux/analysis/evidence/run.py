"""Runs stages into one folder, in parts: what is done stays, what was interrupted goes on, and no table is of two machines.

OUT/STAGE/stage.json says how a stage was run: the manifest of its table. Needs Python's standard library and the program.
"""

import json
import os
import platform
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from datetime import datetime, timezone

from ambilux.analysis.claims import registry
from ambilux.analysis.claims import run as claim_runs
from ambilux.analysis.claims.run import Failed
from ambilux.analysis.evidence import stages

GRACE = 20  # seconds in which an interrupted experiment saves what it has
LEAST = 10  # seconds that must be left for another part to begin
SMI = "name,uuid,driver_version,clocks.sm,clocks.max.sm,utilization.gpu"


class OutOfTime(Exception):
    """The rest is for another call."""


class Clock:
    """How long this call may last."""

    def __init__(self, seconds=0):
        self.end = time.monotonic() + seconds if seconds else None

    def left(self):
        return None if self.end is None else self.end - time.monotonic()

    def check(self):
        if self.end is not None and self.left() < LEAST:
            raise OutOfTime


def now():
    return datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")


def output_of(command):
    """Standard output, or "" where there is no such program."""
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout
    except OSError:
        return ""


def gpus():
    """One dictionary for each device that the driver shows, by the words of SMI."""
    lines = output_of(["nvidia-smi", f"--query-gpu={SMI}", "--format=csv,noheader,nounits"]).splitlines()
    return [dict(zip(SMI.split(","), (cell.strip() for cell in line.split(",")))) for line in lines]


def processor():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


def condition():
    """Of the machine at this moment: load and clocks."""
    return {"date": now(), "load": round(os.getloadavg()[0], 2), "sm_mhz": [g["clocks.sm"] for g in gpus()],
            "gpu_percent": [g["utilization.gpu"] for g in gpus()]}


def facts(place, stage):
    """Revision and machine of a stage."""
    if stage.needs == stages.NOTHING:
        return {"revision": head(place), "card": "no device", "devices": 0, "processor": "", "driver": "", "machine": ""}
    found = gpus() if stage.needs != stages.CPU and not place.quick else []
    cpu = f"{processor()}, {len(os.sched_getaffinity(0))} cores"
    return {"revision": revision(place), "card": found[0]["name"] if found else cpu, "devices": len(found), "processor": cpu,
            "driver": found[0]["driver_version"] if found else "", "machine": " ".join([platform.node(), *(g["uuid"] for g in found)])}


def revision(place):
    """Of the program, which says "ambilux 0.2.0 (0123456789ab-dirty)"."""
    found = re.search(r"\b[0-9a-f]{7,40}(?:-dirty)?\b", output_of([*place.program, "--version"]).split("\n", 1)[0])
    return found[0] if found else "unknown"


def head(place):
    """Revision of the scripts."""
    return output_of(["git", "-C", str(place.root), "rev-parse", "--short=12", "HEAD"]).strip() or revision(place)


def status_file(place, stage):
    return place.folder(stage) / "stage.json"


def status(place, stage):
    """What the stage's manifest says; {} of one that was not begun."""
    file = status_file(place, stage)
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def write(file, text):
    part = file.with_name(file.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(file)


def others(place):
    """Manifests of the stages of this folder."""
    return [(s, found) for s in stages.STAGES if (found := status(place, s))]


def check_folder(place, stage, own):
    """Refuses a second revision, and a second kind of card, in one folder."""
    for other, found in others(place):
        if stages.NOTHING in (other.needs, stage.needs):
            continue
        if found["revision"] != own["revision"]:
            raise Failed(f"{place.out} holds {other.name} of revision {found['revision']}, this is {own['revision']}: take another folder")
        if stages.CPU not in (other.needs, stage.needs) and found["card"] != own["card"]:
            raise Failed(f"{place.out} holds {other.name} of {found['card']}, this is {own['card']}: take another folder")


def begin(place, stage):
    """The manifest of a stage that begins or goes on. What another machine has begun is made anew: its references stay."""
    own, found = facts(place, stage), status(place, stage)
    check_folder(place, stage, own)
    if found and found["machine"] != own["machine"]:
        print(f"{stage.name}: begun on another machine, made anew", flush=True)
        shutil.rmtree(place.folder(stage))
        found = {}
    place.folder(stage).mkdir(parents=True, exist_ok=True)
    return found or {"state": "begun", "quick": place.quick, "seconds": 0, "commands": [], "missing": [], "start": condition(), **own}


def run(place, stage, clock):
    """Runs what is left of a stage; its manifest."""
    found = begin(place, stage)
    start = time.monotonic()
    try:
        clock.check()
        todo = experiment if stage.experiment else claims if stage.name == "claims" else bench
        found.update(todo(place, stage, clock))
        found["state"] = "done"
    except OutOfTime:
        found["state"] = "begun"
    except Failed as e:
        found.update(state="failed", message=str(e))
    found["seconds"] = round(found["seconds"] + time.monotonic() - start, 1)
    found["end"] = condition()
    write(status_file(place, stage), json.dumps(found, indent=1) + "\n")
    return found


def called(command, clock, cwd=None):
    """Standard output of a command, which is interrupted when the time is over."""
    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=cwd)
    except OSError as e:
        raise Failed(f"{command[0]}: {e.strerror}") from None
    left = clock.left()
    try:
        out, err = process.communicate(timeout=None if left is None else max(1, left - GRACE))
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGTERM)
        try:
            process.communicate(timeout=GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        raise OutOfTime from None
    if process.returncode:
        raise Failed((err.strip().splitlines() or [f"{command[0]} ended with {process.returncode}"])[-1])
    return out


def typed(words):
    """As a reader types it."""
    return shlex.join(words).replace("'", "") if not any(" " in w for w in words) else shlex.join(words)


def experiment(place, stage, clock):
    folder = place.folder(stage)
    words = ["experiment", stage.experiment, "-o", os.path.relpath(folder / "results", place.root),
             "--references", os.path.relpath(place.out / "references", place.root), *["--reduced"] * place.quick]
    begun = (folder / "results" / "config.resolved.toml").is_file()
    called([*place.program, "--quiet", *words, *["--resume"] * begun], clock, place.root)
    write(folder / "spread.json", json.dumps(spreads(place, stage, clock), indent=1) + "\n")
    return {"commands": [typed(["ambilux", *words])]}


def spreads(place, stage, clock):
    """[{scene, run, relmse, rmse, pairs}]: half the mean squared difference of two seeds' images, which is their variance."""
    found = {}
    for scene in stage.spread:
        for file in sorted((place.folder(stage) / "results" / "images" / scene).glob("*.exr")):
            run, _, seed = file.stem.rpartition("_")
            if seed.isdigit():
                found.setdefault((scene, run), []).append(str(file))
    out = []
    for (scene, run), files in found.items():
        pairs = [json.loads(called([*place.program, "compare", a, b, "--json", "-"], clock)) for a, b in zip(files, files[1:])]
        if pairs:
            out.append({"scene": scene, "run": run, "seeds": len(files), **{m: half_mean(pairs, m) for m in ("relmse", "rmse")}})
    return out


def half_mean(pairs, measure):
    return sum(p[measure] ** (2 if measure == "rmse" else 1) for p in pairs) / (2 * len(pairs))


def part_command(place, stage, part, count):
    """The words of a part, with what stands for the program, for the folder and for all devices."""
    folder = os.path.relpath(place.folder(stage), place.root)
    every = ",".join(map(str, range(max(1, count))))
    return [{"ALL": every}.get(w, w.replace("OUT/", f"{folder}/")) for w in part["command"]]


def bench(place, stage, clock):
    """Each part writes {"kind", "scene", "key", "json"}; one of a Python script has {"text"} as its JSON."""
    commands, missing, count = [], [], len(gpus())
    for part in stage.parts(place):
        file = place.folder(stage) / part["file"]
        words = part_command(place, stage, part, count)
        commands.append(typed([w for w in words if w not in ("--json", "-", "--quiet")]))
        if file.is_file():
            continue
        clock.check()
        own = {"ambilux": place.program, "python3": (sys.executable,)}[words[0]]
        try:
            out = called([*own, *words[1:]], clock, place.root)
        except Failed as e:
            missing.append(f"{part['scene']}, {part['key']}: {e}")
            continue
        result = json.loads(out) if words[0] == "ambilux" else {"text": out}
        write(file, json.dumps({k: part[k] for k in ("kind", "scene", "key")} | {"json": slim(result)}) + "\n")
    return {"commands": commands, "missing": missing}


def slim(result):
    """Without what no table needs."""
    return {k: v for k, v in result.items() if k not in ("queues", "asked", "selection")}


def claims(place, stage, clock):
    """Claim by claim."""
    where = claim_runs.Place(place.program, place.folder(stage) / "results", place.quick, lambda command: called(command, clock))
    where.out.mkdir(parents=True, exist_ok=True)
    device, missing = claim_runs.has_device(where), []
    for claim in registry.load("experiments/claims"):
        found = claim_runs.status(where.out, claim)
        if found["state"] not in ("run", "dry run"):
            clock.check()
            found = claim_runs.run(claim, where, device)
        if found["state"] == "failed":
            missing.append(f"{claim.name}: {found['message']}")
    return {"commands": ["scripts/evidence.sh run --only claims" + " --quick" * place.quick], "missing": missing}
