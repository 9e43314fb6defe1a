"""Figures of docs/results.md, peers.md, performance.md, claims.md and scaling.md. By scripts/evidence.sh, from the root of the repository.

run     measures stage by stage, those that matter most first; goes on where it stopped. Needs the program and Python alone
pack    what the pages need of it, in files of at most 15 MB, which are unpacked into one folder
page    docs/data, pictures and pages from what was measured; without results: pages from docs/data
status  what was run, and what docs/data holds

Exit codes: 0 done, 1 something failed, 3 bad input, 75 there is more to do.
"""

import argparse
import os
import shlex
import sys
import tarfile
from pathlib import Path

from ambilux.analysis.claims import registry
from ambilux.analysis.claims.run import Failed, devices, has_device
from ambilux.analysis.evidence import run, stages

MORE = 75
MOST_BYTES = 14 << 20  # of files in one archive
LEFT_OUT = ("state", "peers", "figures", "technique")


def chosen(o, place):
    """Those named, else all that this machine can run, by their order."""
    if o.only:
        if unknown := [name for name in o.only if name not in stages.BY_NAME]:
            raise Failed(f"--only {unknown[0]}: there are {', '.join(stages.BY_NAME)}")
        return [s for s in stages.STAGES if s.name in o.only]
    count = len(run.gpus())
    program = run.claim_runs.Place(place.program, place.out, place.quick)
    device = has_device(program)
    fits = {stages.CPU: o.cpu, stages.NOTHING: o.cpu, stages.CUDA: device, stages.DEVICES: count > 1, stages.OPTIX: device and devices(program)["optix"]}
    return [s for s in stages.STAGES if place.quick or fits[s.needs]]


def run_all(o, place):
    clock, failed, more = run.Clock(o.seconds), False, False
    place.out.mkdir(parents=True, exist_ok=True)
    for stage in chosen(o, place):
        if run.status(place, stage).get("state") == "done":
            continue
        found = run.run(place, stage, clock)
        missing = f"; not run: {'; '.join(found['missing'])}" if found["missing"] else ""
        print(f"{stage.name}: {found['state']}, {found['seconds']:.0f} s{missing} {found.get('message', '')}".rstrip(), flush=True)
        failed |= found["state"] == "failed"
        if found["state"] == "begun":
            more = True
            break
    return MORE if more else int(failed)


def shown_images():
    """(stage or experiment of a claim, scene) of which figures show images."""
    claims = [(c.experiment.stem, c.picture) for c in registry.load("experiments/claims") if c.picture and c.experiment]
    return {*claims, *((s.name, scene) for s in stages.STAGES for scene in s.pictures)}


def needed(place, file, shown):
    """Whether a file of a stage is of use at home. shown: of shown_images."""
    inside = file.relative_to(place.out).parts
    if file.suffix in (".json", ".csv", ".toml"):
        return not set(inside) & {"state"}
    if file.suffix != ".exr" or set(inside) & set(LEFT_OUT):
        return False
    if inside[-2] == "references":
        of_claims = inside[0] == "claims"
        return file.name.startswith(tuple(scene for name, scene in shown if of_claims != (name in stages.BY_NAME)))
    return file.stem.endswith("_1") and (inside[0] if inside[0] != "claims" else inside[2], inside[-2]) in shown


def pack(o, place):
    """Archives evidence-1.tar.gz and so on."""
    shown = shown_images()
    files = sorted(file for file in place.out.rglob("*") if file.is_file() and needed(place, file, shown))
    groups, size = [[]], 0
    for file in files:
        if groups[-1] and size + file.stat().st_size > MOST_BYTES:
            groups.append([])
            size = 0
        groups[-1].append(file)
        size += file.stat().st_size
    o.target.mkdir(parents=True, exist_ok=True)
    for i, group in enumerate(groups, 1):
        path = o.target / f"evidence-{i}.tar.gz"
        with tarfile.open(path, "w:gz") as archive:
            for file in group:
                archive.add(file, file.relative_to(place.out))
        print(f"{path}: {len(group)} files, {path.stat().st_size / 1e6:.1f} MB")
    return 0


def page(o, place):
    from ambilux.analysis.evidence import pages
    done = [s for s in stages.STAGES if run.status(place, s).get("state") == "done"]
    if any(run.status(place, s)["quick"] for s in done) and o.docs == place.root / "docs":
        o.docs = place.out / "docs"
        pages.copy(place.root / "docs", o.docs)
    made = pages.collect(done, place, o.docs)
    print(f"docs/data: {', '.join(made) or 'nothing new'}")
    print(f"written: {', '.join(pages.write_all(place.root, o.docs)) or 'no page has changed'}")
    if o.card:
        o.card.write_text(pages.card([s.name for s in done], o.docs), encoding="utf-8")
    return 0


def status(o, place):
    for stage in stages.STAGES:
        found = run.status(place, stage)
        told = f"{found['state']}, {found['seconds']:.0f} s, {found['revision']}, {found['card']}" if found else f"not run; {stage.seconds} s on an H200"
        print(f"{stage.name} ({stage.page}): {told}")
    return 0


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="scripts/evidence.sh", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=["run", "pack", "page", "status"])
    parser.add_argument("-o", "--output", type=Path, help="folder of the results (default: out/evidence, with --quick out/evidence-quick)")
    parser.add_argument("--only", nargs="+", default=[], metavar="STAGE", help="run: these alone")
    parser.add_argument("--seconds", type=float, default=0, help="run: stop after so many; what was done stays")
    parser.add_argument("--cpu", action="store_true", help="run: those of the CPU too, on a machine without other work")
    parser.add_argument("--quick", action="store_true", help="small and on a CPU, to try everything; pages go to OUTPUT/docs")
    parser.add_argument("--target", type=Path, default=Path("out"), help="pack: folder of the archives")
    parser.add_argument("--docs", type=Path, help="page: folder of the pages (default: docs)")
    parser.add_argument("--card", type=Path, metavar="FILE.md", help="page: also every table that was measured, for an issue")
    parser.add_argument("--program", default=os.environ.get("AMBILUX", "build/cli/ambilux"), help="default: $AMBILUX")
    o = parser.parse_args(arguments)
    out = o.output or Path("out/evidence-quick" if o.quick else "out/evidence")
    place = stages.Place(tuple(shlex.split(o.program)), out, o.quick)
    o.docs = o.docs or place.root / "docs"
    try:
        return {"run": run_all, "pack": pack, "page": page, "status": status}[o.step](o, place)
    except Failed as e:
        print(f"error: {e}", file=sys.stderr)
        return 3


if __name__ == "__main__":
    sys.exit(main())
