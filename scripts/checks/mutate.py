#!/usr/bin/env python3
"""Do the tests notice faults? Draws faults at random over sources, compiles them all into one copy of the project and runs the tests with one of them at a time.

Usage: scripts/checks/mutate.py [--seed S] [--count N] [--folder DIR] [--sources FOLDER...] [--tests NAME...] [--jobs N] [--retry] [--only ID...] [--built] [--report]

A fault is an expression that is another than in the source: an operator replaced, a factor dropped, arguments swapped, a value 1 % too
large (scripts/checks/mutation_sites.py). The copy, below the folder, holds both and takes the wrong one where AMBILUX_FAULT is the fault's
number; the project's own sources and builds hold nothing of this. The tests of each fault are those cases that reach it, cheapest first,
until one fails; a crash or a time-out counts as a failure. Interrupted runs go on where they were. With `--jobs` faults are tried side by
side, each on a core of its own. With `--built` the folder is one that another machine has built (source, build/tests, faults.json): nothing
is compiled. `--retry` gives survivors another try after tests have changed. A fault that no test can notice, since it changes nothing that matters, stands with its reason in
scripts/checks/mutation_equivalents.txt and does not count.
Exit status: 0 when at least 95 % were noticed.
"""

import argparse
import concurrent.futures
import hashlib
import json
import os
import queue
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mutation_sites
from mutation_sites import Site

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("transport", "stages", "film", "backends", "render", "integrators", "session")
ELSEWHERE = ("backends/cuda/", "backends/mpi/")  # not compiled by the copy's build: faults there would count as survivors
TEST_FOLDERS = ("transport", "stages", "film", "items", "queues", "scene", "integrators", "backends", "render", "session", "experiments", "cli")
GOAL = 0.95
HEADER = """// Which fault of a mutation run is on.
#pragma once
#include <cstdio>
#include <cstdlib>
namespace ambilux {
struct Mutation {
    int active = 0;
    const char* log = nullptr;
    unsigned char reached[%d] = {};
    Mutation() {
        if (const char* fault = std::getenv("AMBILUX_FAULT")) active = std::atoi(fault);
        log = std::getenv("AMBILUX_FAULT_LOG");
    }
    ~Mutation() {
        std::FILE* file = log ? std::fopen(log, "a") : nullptr;  // a test may run the program
        for (int k = 0; file && k < int(sizeof(reached)); ++k)
            if (reached[k]) std::fprintf(file, "%%d\\n", k);
        if (file) std::fclose(file);
    }
};
inline Mutation the_mutation;
inline bool mutated(int k) {
    if (__builtin_expect(the_mutation.log != nullptr, 0)) the_mutation.reached[k] = 1;
    return __builtin_expect(k == the_mutation.active, 0);
}
}  // namespace ambilux
"""


def run(command, **options):
    return subprocess.run(command, text=True, capture_output=True, errors="replace", **options)


def say(text):
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)


def project_files(*folders):
    return run(["git", "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard", *folders]).stdout.split()


def write(path, text):
    """Writes a file whose text changes, so that a build sees no more than what is new."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(errors="replace") != text:
        path.write_text(text)


class Workspace:
    """The mutated copy and what is known about it."""

    def __init__(self, folder, folders, tests, jobs):
        self.folder, self.source, self.build = folder, folder / "source", folder / "build"
        self.folders, self.tests, self.jobs = folders, tests, jobs
        self.cores = queue.SimpleQueue()
        for core in sorted(os.sched_getaffinity(0))[:jobs]:
            self.cores.put(core)
        self.faults = {}
        self.sources = {n: (ROOT / n).read_text() for n in project_files(*folders) if n.endswith((".h", ".cpp")) and not n.startswith(ELSEWHERE)}

    # ---- faults and their build ----

    def copy(self):
        for name in project_files():
            if not (ROOT / name).is_file() or name in self.sources or name.endswith("registry.list"):
                continue
            target = self.source / name
            if not target.exists() or target.read_bytes() != (ROOT / name).read_bytes():
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, target)
        # One set of kernels instead of one a level of features: a fifth of the build.
        write(self.source / "cmake/registry.cmake", re.sub(r"set\(AMBILUX_LEVELS [^)]*\)", "set(AMBILUX_LEVELS All)", (ROOT / "cmake/registry.cmake").read_text()))
        for name in filter(lambda n: n.endswith("registry.list"), project_files()):
            write(self.source / name, re.sub(r"(?m)^((?:\w\S* +){4}\w\S*).*", r"\1", (ROOT / name).read_text()))

        # The twin in double precision is made from the sources without faults: it checks, it is not checked.
        twin = (ROOT / "cmake/double_precision.cmake").read_text()
        write(self.source / "cmake/double_precision.cmake", twin.replace("-DSOURCE=${PROJECT_SOURCE_DIR}", f"-DSOURCE={ROOT}"))

    def rewrite(self):
        by_file = {}
        for number, site in self.faults.items():
            by_file.setdefault(site.file, []).append((number, site))
        for name, text in self.sources.items():
            write(self.source / name, mutation_sites.rewrite(text, by_file[name]) if name in by_file else text)
        write(self.source / "core/mutation.h", HEADER % (max(self.faults) + 1))

    def configure(self):
        result = run(["cmake", "-S", self.source, "-B", self.build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DAMBILUX_CUDA=OFF"])
        if result.returncode:
            sys.exit(result.stdout + result.stderr)

    def lines_of_errors(self, text, folder):
        """Files of the copy and lines that a compiler's messages name."""
        found = re.finditer(r"^(\S+?):(\d+):(?:\d+:)?\s+(?:error|required from|in .constexpr. expansion)", text, re.MULTILINE)
        return {(os.path.relpath(os.path.normpath(Path(folder) / m[1]), self.source), int(m[2])) for m in found}

    def faults_at(self, lines):
        """Faults that stand in those lines."""
        # The rewritten file has one line more, the include.
        found = {number for number, site in self.faults.items() for file, line in lines if file == site.file and site.line <= line - 1 <= site.last_line}
        if lines and not found:
            # A compiler may name another line of the statement: the nearest fault of the file is left out.
            near = [(abs(site.line - line), number) for number, site in self.faults.items() for file, line in lines if file == site.file]
            if not near:
                sys.exit(f"the copy does not compile, and no fault explains it: {sorted(lines)[:5]}")
            found = {min(near)[1]}
        return found

    def save(self):
        (self.folder / "faults.json").write_text(json.dumps({"key": self.key, "faults": {k: vars(s) for k, s in self.faults.items()}}, indent=1))

    def broken(self):
        """Faults that do not compile, by the compiler's messages about a few files that include all of the others."""
        lines = set()

        def errors(entry):
            command = re.sub(r"^(env \S+ )?\S*ccache ", "", re.sub(r" -o \S+", "", entry["command"])) + " -fsyntax-only -w -fmax-errors=0"
            return self.lines_of_errors(run(command, shell=True, cwd=entry["directory"]).stderr, entry["directory"])

        including = r"/(\w+_All|bsdf_plugins|(?:film|backends|render|session|integrators)/[\w/]+|test_stages|test_bidirectional_stages)\.cpp$"
        commands = [c for c in json.loads((self.build / "compile_commands.json").read_text()) if re.search(including, c["file"])]
        with concurrent.futures.ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            for of_file in pool.map(errors, commands):
                lines |= of_file
        return self.faults_at(lines)

    def read(self):
        """Faults of a copy that is built already."""
        self.faults = {int(k): Site(**s) for k, s in json.loads((self.folder / "faults.json").read_text())["faults"].items()}

    def draw(self, seed, count):
        """Draws faults, without those that do not compile, or reads those of an earlier run."""
        self.key = hashlib.sha256(json.dumps([seed, count, self.sources], sort_keys=True).encode()).hexdigest()
        known = self.folder / "faults.json"
        if known.exists() and json.loads(known.read_text())["key"] == self.key:
            self.read()
            self.copy(), self.rewrite(), self.configure()
            return
        for old in ("results.jsonl", "cases.json"):
            (self.folder / old).unlink(missing_ok=True)
        sites = [s for name in sorted(self.sources) for s in mutation_sites.sites_of(name, self.sources[name])]
        say(f"{len(sites)} places for faults in {len(self.sources)} files")
        dropped = set()
        self.copy()
        # One error hides others, so that it takes several rounds. Twice as many first: those that take the place of broken ones are among them.
        for tried in (2 * count, count):
            broken = True
            while broken:
                drawn = mutation_sites.draw(sites, tried, random.Random(seed), dropped)
                self.faults = dict(enumerate(drawn, 1))
                self.rewrite(), self.configure()
                broken = self.broken()
                say(f"{len(drawn)} faults drawn, {len(broken)} of them do not compile")
                dropped |= {self.faults[k] for k in broken}
        self.save()

    def compile(self):
        say("building " + " ".join(self.tests))
        began = time.time()
        # Compilers say more about what is unreachable or unused in faults than in sources.
        command = ["nice", "cmake", "--build", self.build, "-j", str(len(os.sched_getaffinity(0))), "--target", *self.tests, "--", "-k", "0"]
        while (result := run(command)).returncode:
            broken = self.faults_at(self.lines_of_errors(result.stdout, self.build))
            if not broken:
                sys.exit("the build failed\n" + result.stdout[-4000:])
            say(f"{len(broken)} faults more do not compile, and are left out")
            for number in broken:
                del self.faults[number]
            self.rewrite(), self.save()
        say(f"built in {time.time() - began:.0f} s")

    # ---- running tests ----

    def run_case(self, test, case, fault=0, limit=None, log=None):
        """'pass', 'fail' or 'time-out', and seconds."""
        environment = {**os.environ, "AMBILUX_FAULT": str(fault)}
        environment.pop("AMBILUX_FAULT_LOG", None)
        if log:
            environment["AMBILUX_FAULT_LOG"] = str(log)
        name = re.sub(r'([\\,\["])', r"\\\1", case)
        core = self.cores.get() if self.jobs > 1 else None
        command = ["nice", self.build / "tests" / test, name, "-a"]
        began = time.time()
        try:
            code = run(command if core is None else ["taskset", "-c", str(core), *command], env=environment, timeout=limit, cwd=self.build).returncode
        except subprocess.TimeoutExpired:
            return "time-out", time.time() - began
        finally:
            if core is not None:
                self.cores.put(core)
        return ("pass" if code == 0 else "fail"), time.time() - began

    def side_by_side(self, function, items):
        """(item, function(item)) as they are ready, as many at a time as there are jobs."""
        with concurrent.futures.ThreadPoolExecutor(self.jobs) as pool:
            running = {pool.submit(function, item): item for item in items}
            try:
                for done in concurrent.futures.as_completed(running):
                    yield running[done], done.result()
            finally:
                pool.shutdown(cancel_futures=True)

    def reach(self, test_and_case):
        """Verdict, seconds and reached faults of a case without a fault."""
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "reached.txt"
            verdict, seconds = self.run_case(*test_and_case, log=log)
            return verdict, seconds, [int(k) for k in log.read_text().split()] if log.exists() else None

    def baseline(self):
        """Seconds and reached faults of every case without a fault; cases that fail then are left out."""
        path = self.folder / "cases.json"
        cases = json.loads(path.read_text()) if path.exists() else {}
        waiting = []
        for test in self.tests:
            program = self.build / "tests" / test
            stamp = hashlib.sha256(program.read_bytes()).hexdigest()
            if cases.get(test, {}).get("stamp") == stamp:
                continue
            listed = run([program, "--list-test-names-only"])
            if "Unrecognised token" in listed.stdout + listed.stderr:  # Catch2 3
                listed = run([program, "--list-tests", "--verbosity", "quiet"])
            names = list(filter(None, map(str.strip, listed.stdout.splitlines())))
            waiting += [(test, case) for case in names]
            cases[test] = {"stamp": stamp, "cases": {}}
        for (test, case), (verdict, seconds, reached) in self.side_by_side(self.reach, waiting):
            if verdict == "pass" and reached is not None:
                cases[test]["cases"][case] = {"seconds": seconds, "reached": reached}
            else:
                say(f"left out, since it fails without a fault: {test}: {case}")
        if waiting:
            path.write_text(json.dumps(cases, indent=1))
            say(f"{len(waiting)} cases, {sum(c['seconds'] for known in cases.values() for c in known['cases'].values()):.0f} s")
        order = [(c["seconds"], test, name, set(c["reached"])) for test in self.tests for name, c in cases[test]["cases"].items()]
        return sorted(order, key=lambda c: c[:3])

    def results(self):
        path = self.folder / "results.jsonl"
        lines = path.read_text().splitlines() if path.exists() else []
        return {r["fault"]: r for r in map(json.loads, lines)}

    def run_faults(self, numbers):
        cases = self.baseline()
        reaching = {number: [c for c in cases if number in c[3]] for number in numbers}
        left, spent, killed, began = {k: len(reaching[k]) for k in numbers}, dict.fromkeys(numbers, 0.0), set(), time.time()

        def try_case(number_and_case):
            number, (seconds, test, case, _) = number_and_case
            return ("skipped", 0) if number in killed else self.run_case(test, case, number, limit=30 + 10 * seconds)

        def conclude(number, how, by):
            result = {"fault": number, "killed": how != "survived", "by": by, "how": how, "seconds": round(spent[number], 1)}
            with open(self.folder / "results.jsonl", "a") as f:
                f.write(json.dumps(result) + "\n")
            done = len(killed) + sum(not left[k] for k in numbers if k not in killed)
            minutes = (time.time() - began) / done * (len(numbers) - done) / 60
            say(f"[{done}/{len(numbers)}, {minutes:.0f} min left] {number} {how} ({by}; {result['seconds']} s): {self.faults[number].describe()}")

        for number in (k for k in numbers if not left[k]):
            conclude(number, "survived", "0 cases reach it")
        # Cases of a fault side by side, since a survivor has to pass all of them.
        for (number, case), (verdict, took) in self.side_by_side(try_case, [(k, c) for k in numbers for c in reaching[k]]):
            spent[number] += took
            left[number] -= 1
            if verdict not in ("pass", "skipped") and number not in killed:
                killed.add(number)
                conclude(number, verdict, f"{case[1]}: {case[2]}")
            elif not left[number] and number not in killed:
                conclude(number, "survived", f"{len(reaching[number])} cases reach it")


def flat(text):
    return " ".join(text.split())


def equivalents():
    """(file, source line, original, mutated) to reason, from lines of these five separated by tabs."""
    path = ROOT / "scripts/checks/mutation_equivalents.txt"
    lines = [line.split("\t") for line in path.read_text().splitlines() if line and not line.startswith("#")] if path.exists() else []
    return {tuple(flat(p) for p in line[:4]): line[4].strip() for line in lines}


def report(workspace):
    results, known = workspace.results(), equivalents()
    line = lambda s: workspace.sources[s.file].splitlines()[s.line - 1]
    reason = {k: known.get((s.file, flat(line(s)), flat(s.original), flat(s.mutated))) for k, s in workspace.faults.items()}
    tried = [k for k in workspace.faults if k in results and not reason[k]]
    survivors = [k for k in tried if not results[k]["killed"]]
    for k in workspace.faults:
        if reason[k]:
            print(f"equivalent {k}: {workspace.faults[k].describe()} ({reason[k]})")
    for k in survivors:
        print(f"survived {k} ({results[k]['by']}): {workspace.faults[k].describe()}")
    rate = 1 - len(survivors) / len(tried) if tried else 0
    print(f"{len(workspace.faults)} faults, {sum(map(bool, reason.values()))} equivalent, {len(tried)} tried: {len(tried) - len(survivors)} killed, {len(survivors)} survived, {100 * rate:.1f} %")
    return 0 if tried and rate >= GOAL else 1


def default_tests():
    """Tests of the CPU without a label; those of formats, statistics and stress say little about these folders for their time."""
    names = []
    for name in project_files("tests"):
        path = ROOT / name
        if path.match("test_*.cpp") and path.parent.name in TEST_FOLDERS and not re.search(r"^// labels:", path.read_text(), re.MULTILINE):
            names.append(path.stem)
    return names


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=80)
    parser.add_argument("--folder", type=Path, default=ROOT / "build-mutate", help="where the copy, its build and the results lie")
    parser.add_argument("--sources", nargs="+", choices=FOLDERS, default=FOLDERS, help="folders that faults are drawn from")
    parser.add_argument("--tests", nargs="+", help="test programs instead of all that are quick")
    parser.add_argument("--jobs", type=int, default=1, help="how many faults are tried side by side")
    parser.add_argument("--built", action="store_true", help="the folder holds a copy that is built")
    parser.add_argument("--retry", action="store_true", help="try survivors again")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of the faults to try")
    parser.add_argument("--report", action="store_true", help="print what is known and end")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    workspace = Workspace(options.folder.resolve(), tuple(options.sources), options.tests or default_tests(), options.jobs)
    if options.built:
        workspace.read()
    else:
        workspace.draw(options.seed, options.count)
    if not options.report:
        if not options.built:
            workspace.compile()
        results = workspace.results()
        again = lambda k: k not in results or (options.retry and not results[k]["killed"])
        workspace.run_faults(options.only or [k for k in workspace.faults if again(k)])
    return report(workspace)


if __name__ == "__main__":
    sys.exit(main())
