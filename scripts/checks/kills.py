#!/usr/bin/env python3
"""Kills renders, references, experiments and analyses at random moments and looks at what is left.

Usage: scripts/checks/kills.py [--program AMBILUX] [--seed S] [--count N] [--folder DIR] [--kinds KIND...]

Work of a second is begun again and again in one folder and ended by SIGKILL, SIGTERM, SIGINT or SIGHUP, drawn with the moment by the seed, until it has
been ended so five times or is done; then it is run to its end. Checked after each:
  the exit code: 5, or 0 when it was done, or the signal's own before the program could handle it;
  nothing that was saved is lost: samples of a reference and rows of an experiment never become fewer, a render that says it saved has an image that can be read;
  no temporary file is left, but by SIGKILL, whose leftovers are counted.
And at the end: images, references and rows are those of work that nobody ended, to the last bit, and nothing else lies there.
Exit status: 0 if all of it holds, 1 if not.
"""

import argparse
import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python"))
os.environ["PYTHONPATH"] = str(ROOT / "python")  # of the analyses that it starts
from ambilux.analysis.images import read_exr  # noqa: E402

SIGNALS = [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP]
IN_A_ROW = 5
CORNELL = ROOT / "scenes/cornell.xml"
EXPERIMENT = f"""seeds = [1, 2]
[reference]
spp = 128
[budget]
spp = [1, 3, 9]
[[scene]]
name = "cornell"
path = "{CORNELL}"
size = [32, 24]
max_depth = 4
[[run]]
name = "path"
integrator = "path"
sweep = {{ estimator = ["nee", "mis"] }}
[[run]]
name = "lvc"
integrator = "bdpt"
variant = "lvc"
"""


def is_temporary(name):
    return ".tmp-" in name or name.endswith(".part")


def files_of(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


class Render:
    """Has no state: what is saved is an image of fewer samples, and the next one starts anew."""

    def command(self, program, folder):
        return [program, "render", CORNELL, "--size", "48x32", "--spp", "800", "-o", folder / "a.exr", "--json", folder / "a.json"]

    def progress(self, folder, said):
        if (folder / "a.exr").exists():
            read_exr(folder / "a.exr")
        elif "a.exr: " in said:
            raise AssertionError("it says that the image was saved, and there is none")
        return 0

    def result(self, folder):
        return read_exr(folder / "a.exr").tobytes()


class Reference:
    def command(self, program, folder):
        return [program, "reference", CORNELL, "--size", "48x32", "--spp", "800", "-o", folder / "ref.exr"]

    def progress(self, folder, _):
        if not (folder / "ref.exr").exists():
            return 0
        import OpenEXR

        return int(OpenEXR.File(str(folder / "ref.exr")).header()["spp"])

    def result(self, folder):
        return read_exr(folder / "ref.exr").tobytes()


class Experiment:
    def command(self, program, folder):
        config = folder.with_suffix(".toml")
        config.write_text(EXPERIMENT)
        return [program, "experiment", config, "-o", folder / "out", "--resume"]

    def progress(self, folder, _):
        runs = folder / "out/runs.csv"
        return len(runs.read_text().splitlines()) if runs.exists() else 0

    def result(self, folder):
        with open(folder / "out/runs.csv", newline="") as f:
            rows = [{k: v for k, v in row.items() if k != "time"} for row in csv.DictReader(f)]
        images = [read_exr(folder / name).tobytes() for name in files_of(folder) if name.endswith(".exr")]
        return rows, images


class Analysis:
    """Of the results of one experiment, which it must leave as they are."""

    def __init__(self, results):
        self.results = results

    def command(self, program, folder):
        return [sys.executable, "-m", "ambilux.analysis", self.results, "-o", folder / "report"]

    def progress(self, folder, _):
        return 0

    def result(self, folder):
        return {n: (folder / n).read_bytes() for n in files_of(folder) if n.endswith((".csv", ".tex"))}


def run(command, folder, ended_after=None, by=None):
    """Exit code, messages and seconds."""
    began = time.time()
    child = subprocess.Popen([str(c) for c in command], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if ended_after is not None:
        time.sleep(ended_after)
        child.send_signal(by)
    try:
        said = child.communicate(timeout=300)[1]
    except subprocess.TimeoutExpired:
        child.kill()
        raise AssertionError(f"it goes on after {by.name if by else 'five minutes'}") from None
    return child.returncode, said, time.time() - began


class Kills:
    def __init__(self, program, seed, folder):
        self.program, self.random, self.folder = program, random.Random(seed), folder
        self.known = {}  # kind: result, files and seconds of work that nobody ended
        self.counts = Counter()
        self.failures = []

    def baseline(self, name, kind):
        folder = self.folder / f"{name}-whole"
        folder.mkdir()
        code, said, seconds = run(kind.command(self.program, folder), folder)
        if code != 0:
            sys.exit(f"{name} fails undisturbed: {said}")
        self.known[name] = (kind.result(folder), files_of(folder), seconds)

    def check(self, name, kind, folder, by, code, said, before):
        """Progress, after the checks of one kill."""
        # Python's own answer to SIGINT is an exit code of 1 or the signal.
        early = {-by, 5, 0, 130, 1 if name == "analysis" and by == signal.SIGINT else 0}
        if code not in early:
            raise AssertionError(f"exit code {code} after {by.name}: {said[-300:]}")
        left = [n for n in files_of(folder) if is_temporary(n)]
        self.counts["temporary files left by SIGKILL"] += len(left) if by == signal.SIGKILL else 0
        # A handler that never ran, at the start of the program or in Python, cannot remove anything.
        if left and by != signal.SIGKILL and self.temporary_before != left:
            raise AssertionError(f"{by.name} leaves {left}")
        self.temporary_before = left
        now = kind.progress(folder, said)
        if now < before:
            raise AssertionError(f"{by.name}: {before} were saved and {now} are left")
        return now

    def chain(self, name, kind, number, most):
        """Ends the same work up to `most` times; returns how often, and leaves no folder if all went well."""
        result, files, seconds = self.known[name]
        folder = self.folder / f"{name}-{number}"
        folder.mkdir()
        self.temporary_before = []
        kills, saved = 0, 0
        try:
            while kills < most:
                by, after = self.random.choice(SIGNALS), self.random.uniform(0, 1.1) * seconds
                code, said, _ = run(kind.command(self.program, folder), folder, after, by)
                if code == 0:
                    self.counts[f"{name} done before the signal"] += 1
                saved = self.check(name, kind, folder, by, code, said, saved)
                kills += 1
                self.counts[f"{name} by {by.name}"] += 1
            code, said, _ = run(kind.command(self.program, folder), folder)
            if code != 0:
                raise AssertionError(f"it cannot be finished: code {code}: {said[-300:]}")
            if kind.result(folder) != result:
                raise AssertionError("its result is another one")
            left = [n for n in files_of(folder) if n not in files and not is_temporary(n)]
            missing = [n for n in files if n not in files_of(folder)]
            if left or missing:
                raise AssertionError(f"too much is there: {left}; missing: {missing}")
            shutil.rmtree(folder)
        except AssertionError as e:
            self.failures.append(f"{name}-{number}: {e}")
            print(f"FAILED {self.failures[-1]}", flush=True)
        return kills


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build/cli/ambilux")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--folder", type=Path, help="where the work lies; what failed stays there")
    # An analysis takes ten times as long as the others.
    parser.add_argument("--kinds", nargs="+", default=3 * ["render", "reference", "experiment"] + ["analysis"])
    options = parser.parse_args()
    folder = options.folder or Path(tempfile.mkdtemp(prefix="ambilux-kills-"))
    folder.mkdir(parents=True, exist_ok=True)
    program = options.program.resolve()
    kills = Kills(program, options.seed, folder)
    kinds = {"render": Render(), "reference": Reference(), "experiment": Experiment(), "analysis": Analysis(folder / "experiment-whole/out")}
    for name, kind in kinds.items():
        if name in options.kinds or (name == "experiment" and "analysis" in options.kinds):
            kills.baseline(name, kind)
    done = number = 0
    while done < options.count:
        name = options.kinds[number % len(options.kinds)]
        done += kills.chain(name, kinds[name], number, min(IN_A_ROW, options.count - done)) or 1
        number += 1
    for what, count in sorted(kills.counts.items()):
        print(f"{count:5} {what}")
    print(f"{done} kills with seed {options.seed}, {len(kills.failures)} failures")
    if not kills.failures:
        shutil.rmtree(folder)
    return 1 if kills.failures else 0


if __name__ == "__main__":
    sys.exit(main())
