#!/usr/bin/env python3
"""This machine's card in one page of Markdown, for an issue: rays, stages, and samples a second beside Mitsuba's on the same card (docs/performance.md).

    scripts/bench/device.py PROGRAM [SCENE...] [--backend cuda] [--size 512x512] [--spp 256] > card.md

Without scenes those of the project. Mitsuba (cuda_ad_rgb; on a CPU llvm_ad_rgb) has a row where AMBILUX_PEERS_PYTHON names a Python with it. Samples of a pixel times pixels
over the time of rendering; the median of three seeds. About two minutes.
"""

import argparse
import csv
import json
import os
import pathlib
import statistics
import subprocess
import tempfile

from scenes_and_methods import name_of, parser_for, settings_of

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = ("cornell", "glass", "lights", "textured")
SEEDS = [1, 2, 3]


def run(*command):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stderr.strip()}")
    return done.stdout


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    print("\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n", flush=True)


def of_bench(a, what, scene, *more):
    with tempfile.NamedTemporaryFile(suffix=".json") as out:
        run(a.program, "bench", what, scene, "--backend", a.backend, "--size", a.size, "--json", out.name, *more)
        return json.loads(pathlib.Path(out.name).read_text())


def rays(a):
    """Millions a second, by batch; once more by OptiX, where the program and the driver have it."""
    rays_by(a)
    if a.backend == "cuda":
        asked = subprocess.run([a.program, "bench", "rays", a.scenes[0], "--backend", "cuda-optix", "--repetitions", "1"], capture_output=True, text=True)
        if asked.returncode:
            print(f"Without OptiX: {asked.stderr.strip()}\n")
        else:
            print("By OptiX, which runs in software on devices without ray tracing cores:\n")
            rays_by(argparse.Namespace(**{**vars(a), "backend": "cuda-optix"}))


def rays_by(a):
    found = {scene: {row["batch"]: row["mrays_per_s"] for row in of_bench(a, "rays", scene)["rows"]} for scene in a.scenes}
    batches = list(dict.fromkeys(batch for of_scene in found.values() for batch in of_scene))
    table(["Mrays/s", *batches], [[name_of(scene), *(f"{of_scene[b]:.4g}" if b in of_scene else "" for b in batches)] for scene, of_scene in found.items()])


def stages(a):
    """The four stages that take most of a render, in nanoseconds an item and shares."""
    rows = []
    for scene in a.scenes:
        for method in a.methods:
            options = [word for setting in settings_of(method) for word in ("--set", "=".join(setting))]
            found = of_bench(a, "stages", scene, "--spp", a.spp, *options)["stages"]
            whole = sum(stage["seconds"] for stage in found)
            most = sorted(found, key=lambda stage: -stage["seconds"])[:4]
            rows.append([name_of(scene), method, *(f"{s['name']} {s['seconds'] / whole:.0%}, {1e9 * s['seconds'] / max(s['items'], 1):.2f} ns" for s in most)])
    table(["scene", "method", "stages by time, ns an item", "", "", ""], rows)


def label(method):
    """As a run may be called."""
    return method.replace(" ", "-").replace("=", "-")


def run_of(method):
    """In a configuration."""
    settings = dict(settings_of(method))
    keys = "".join(f'{key} = "{settings.pop(key)}"\n' for key in ("integrator", "variant") if key in settings)
    return f'[[run]]\nname = "{label(method)}"\n{keys}set = {{ {", ".join(f"{k} = {v}" for k, v in settings.items())} }}\n'


def samples(a):
    """Millions a second, of paths of up to eight segments. An experiment without errors: its references have two samples."""
    width, height = map(int, a.size.split("x"))
    variant = "cuda_ad_rgb" if a.backend == "cuda" else "llvm_ad_rgb"
    runs = [run_of(method) for method in a.methods]
    if os.environ.get("AMBILUX_PEERS_PYTHON"):
        runs.append(f'[[run]]\nname = "mitsuba-path"\nrenderer = "mitsuba"\nintegrator = "path"\nvariant = "{variant}"\n')
    scenes = [f'[[scene]]\nname = "{name_of(s)}"\npath = "{pathlib.Path(s).resolve()}"\nsize = [{width}, {height}]\nmax_depth = 8\n' for s in a.scenes]
    with tempfile.TemporaryDirectory() as folder:
        config = pathlib.Path(folder) / "card.toml"
        config.write_text(f'name = "card"\nbackend = "{a.backend}"\nfilter = "box"\nseeds = {SEEDS}\n[reference]\nspp = 2\n[budget]\nspp = [{a.spp}]\n'
                          + "".join(scenes + runs))
        run(a.program, "experiment", config, "-o", f"{folder}/out")
        with open(f"{folder}/out/runs.csv", newline="") as file:
            found = list(csv.DictReader(file))
    names = list(dict.fromkeys(row["run"] for row in found))

    def rate(scene, name):
        times = [float(row["time"]) / float(row["spp"]) for row in found if row["scene"] == name_of(scene) and row["run"] == name]
        return f"{width * height / statistics.median(times) / 1e6:.3g}" if times else ""

    table([f"Msamples/s, {a.size}", *names], [[name_of(scene), *(rate(scene, name) for name in names)] for scene in a.scenes])


def main():
    parser = parser_for(__doc__, methods=True, scenes=[str(ROOT / "scenes" / f"{name}.xml") for name in SCENES])
    parser.add_argument("--spp", type=int, default=256)
    parser.set_defaults(size="512x512")
    a = parser.parse_args()
    print(run(a.program, "--version").splitlines()[0] + "\n\n```\n" + run(a.program, "devices").strip() + "\n```\n", flush=True)
    for part in (rays, stages, samples):
        part(a)


if __name__ == "__main__":
    main()
