"""Benches that guard ratios of times, not times: medians of runs that take turns, so that both sides see the same machine.

Usage: bench_guard.py [--program FILE] [--loop-test FILE] [--scene FILE] [--backend NAME] [--size WxH] [--spp N] [--runs N] [CHECK...]

Checks, all by default:
  loop       G10: wavefront of the path tracer on the CPU over a plain loop that calls the same functions, at most 1.5
  defined    G15: the scene with definitions of materials that no shape has over the scene, at most 1.05
  shade      shading of a vertex on the CPU, next event estimation included, over tracing its ray by Embree, which does not change with our
             code: scenes/glass.xml,
             at most 2.7 (2.0 to 2.1 measured)
  unseen     G15: the scene with a speck of every material behind the camera's walls over the scene, at most 1.5
Prints both medians, their ratio and its limit for each. Exit status 1 if a ratio is above its limit, 2 if a run failed.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIMITS = {"loop": 1.5, "shade": 2.7, "defined": 1.05, "unseen": 1.5}

MATERIALS = [
    '<bsdf type="roughconductor" {id}><string name="material" value="Ag"/><float name="alpha" value="0.2"/></bsdf>',
    '<bsdf type="roughdielectric" {id}><float name="alpha" value="0.1"/></bsdf>',
    '<bsdf type="roughplastic" {id}><float name="alpha" value="0.3"/></bsdf>',
    '<bsdf type="plastic" {id}/>',
    '<bsdf type="dielectric" {id}/>',
]


def with_definitions(xml):
    """The scene and definitions that nothing refers to."""
    extra = "".join(m.format(id=f'id="guard_{i}"') for i, m in enumerate(MATERIALS))
    return xml.replace("</scene>", extra + "</scene>")


def with_specks(xml):
    """The scene and a tiny rectangle of every material far below it, where a closed scene has no rays."""
    place = '<transform name="to_world"><scale value="1e-3"/><translate x="{x}" y="-3" z="-3"/></transform>'
    extra = "".join(
        '<shape type="rectangle">' + place.format(x=0.01 * i) + m.format(id="") + "</shape>" for i, m in enumerate(MATERIALS)
    )
    return xml.replace("</scene>", extra + "</scene>")


def render_seconds(args, scene, folder):
    """Seconds of rendering, and the features of the kernels."""
    statistics_file = folder / "statistics.json"
    command = [args.program, "render", scene, "-o", folder / "image.exr", "--size", args.size, "--spp", str(args.spp), "--backend", args.backend]
    subprocess.run([*map(str, command), "--json", str(statistics_file)], check=True, capture_output=True)
    report = json.loads(statistics_file.read_text())
    return report["seconds"]["render"], report["features"]


def compare_scenes(args, change):
    """Medians of the scene and of the changed one."""
    source = Path(args.scene).resolve()
    times = {"plain": [], "changed": []}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # Beside the original, since a scene names files relative to itself.
        changed = source.with_name(f".{source.stem}.bench_guard_{os.getpid()}.xml")
        changed.write_text(change(source.read_text()))
        try:
            for _ in range(args.runs):
                for which, scene in (("plain", source), ("changed", changed)):
                    times[which].append(render_seconds(args, scene, folder)[0])
        finally:
            changed.unlink()
    return statistics.median(times["plain"]), statistics.median(times["changed"])


def compare_loop(args):
    """Medians of the plain loop and of the wavefront."""
    environment = os.environ | {
        "AMBILUX_BENCH_SCENE": str(Path(args.scene).resolve()),
        "AMBILUX_BENCH_RUNS": str(args.runs),
        "AMBILUX_BENCH_SPP": str(args.spp),
    }
    output = subprocess.run([args.loop_test, "[.bench]"], check=True, capture_output=True, text=True, env=environment).stdout
    pairs = [tuple(map(float, m)) for m in re.findall(r"^bench: plain (\S+) wavefront (\S+)$", output, re.MULTILINE)]
    if len(pairs) != args.runs:
        raise RuntimeError(f"{args.loop_test} reported {len(pairs)} runs, not {args.runs}")
    return statistics.median(p for p, _ in pairs), statistics.median(w for _, w in pairs)


def compare_stages(args):
    """Medians of the seconds of extend and of shade."""
    times = {"extend": [], "shade": []}
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "stages.json"
        command = [args.program, "bench", "stages", ROOT / "scenes/glass.xml", "-i", "path", "--backend", "cpu", "--size", args.size, "--spp", str(args.spp)]
        for _ in range(args.runs):
            subprocess.run([*map(str, command), "--json", str(told)], check=True, capture_output=True)
            for stage in json.loads(told.read_text())["stages"]:
                if stage["name"] in times:
                    times[stage["name"]].append(stage["seconds"])
    return statistics.median(times["extend"]), statistics.median(times["shade"])


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=ROOT / "build-cpu/cli/ambilux")
    parser.add_argument("--loop-test", default=ROOT / "build-cpu/tests/test_plain_loop")
    parser.add_argument("--scene", default=ROOT / "scenes/cornell.xml")
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--size", default="256x256")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("checks", nargs="*", metavar="CHECK", help=", ".join(LIMITS))
    args = parser.parse_args(arguments)
    for check in args.checks:
        if check not in LIMITS:
            parser.error(f"no check {check}; there are {', '.join(LIMITS)}")
    compare = {
        "loop": lambda: compare_loop(args),
        "shade": lambda: compare_stages(args),
        "defined": lambda: compare_scenes(args, with_definitions),
        "unseen": lambda: compare_scenes(args, with_specks),
    }
    slow = False
    for check in args.checks or LIMITS:
        try:
            before, after = compare[check]()
        except (OSError, RuntimeError, subprocess.CalledProcessError) as error:
            print(f"bench_guard: {check}: {error}", file=sys.stderr)
            return 2
        ratio = after / before
        slow |= ratio > LIMITS[check]
        print(f"{check}: {before:.4f} s and {after:.4f} s, ratio {ratio:.3f}, at most {LIMITS[check]}{' - too slow' if ratio > LIMITS[check] else ''}")
    return int(slow)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
