#!/usr/bin/env python3
"""Rates of rays in a scene of instances and in the same scene of copies, and what both hold in memory.

    scripts/bench/bench_instances.py [--ambilux build/ambilux] [--backend cpu|cpu-cwbvh|cuda] [--out out/instances]
                               [--rows 96] [--places 64] [--only shared|copied] [--write]

Writes OUT/forest.xml: bumpy balls of 4 * ROWS * (ROWS - 1) triangles in PLACES places, scaled, turned and some of them
mirrored, on a floor under a sky and a lamp. Runs `ambilux info` and `ambilux bench rays` with --limits copies=1
(instances) and without a limit (copies). --write only writes the scene, --only leaves one of the two out: for scenes
that do not fit as copies, such as --rows 500 --places 1000 (a billion triangles).
"""
import argparse
import json
import math
import os
import random
import struct
import subprocess


def write_ball(path, rows):
    columns = 2 * rows
    vertices, faces = [], []
    for i in range(rows + 1):
        for j in range(columns + 1):
            theta, phi = math.pi * i / rows, 2 * math.pi * j / columns
            r = 1 + 0.1 * math.sin(9 * theta) * math.cos(8 * phi)
            n = (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))
            vertices.append(struct.pack("<6f", r * n[0], r * n[1], r * n[2], *n))
    for i in range(rows):
        for j in range(columns):
            a = i * (columns + 1) + j
            b = a + columns + 1
            if i > 0:
                faces.append(struct.pack("<B3i", 3, a, b, a + 1))
            if i + 1 < rows:
                faces.append(struct.pack("<B3i", 3, a + 1, b, b + 1))
    header = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(vertices)
    header += "".join("property float %s\n" % name for name in ("x", "y", "z", "nx", "ny", "nz"))
    header += "element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(faces)
    with open(path, "wb") as file:
        file.write(header.encode() + b"".join(vertices) + b"".join(faces))
    return len(faces)


def write_scene(folder, rows, places):
    os.makedirs(folder, exist_ok=True)
    triangles = write_ball(os.path.join(folder, "ball.ply"), rows)
    rng = random.Random(1)
    side = math.ceil(math.sqrt(places))
    shapes = []
    for k in range(places):
        x, y = 2.4 * (k % side - side / 2 + 0.5), 2.4 * (k // side - side / 2 + 0.5)
        sx, sy, sz = (rng.uniform(0.6, 1.1) for _ in range(3))
        shapes.append(
            "<shape type='instance'><ref id='g'/><transform name='to_world'><scale x='%g' y='%g' z='%g'/>"
            "<rotate x='%g' y='%g' z='1' angle='%g'/><translate x='%g' y='%g' z='1'/></transform></shape>"
            % (-sx if k % 5 == 0 else sx, sy, sz, rng.random(), rng.random(), rng.uniform(0, 360), x, y))
    size = 1.3 * side
    text = """<scene version='3.0.0'>
<integrator type='path'><integer name='max_depth' value='8'/></integrator>
<sensor type='perspective'><float name='fov' value='45'/><transform name='to_world'>
<lookat origin='0,%g,%g' target='0,0,0' up='0,0,1'/></transform><film type='hdrfilm'>
<integer name='width' value='512'/><integer name='height' value='512'/></film></sensor>
<emitter type='constant'><rgb name='radiance' value='0.5'/></emitter>
<shape type='shapegroup' id='g'><shape type='ply'><string name='filename' value='ball.ply'/>
<bsdf type='diffuse'/></shape></shape>
%s
<shape type='rectangle'><transform name='to_world'><scale value='%g'/></transform></shape>
<shape type='rectangle'><transform name='to_world'><scale value='%g'/><rotate x='1' angle='180'/>
<translate z='%g'/></transform><emitter type='area'><rgb name='radiance' value='8'/></emitter></shape>
</scene>
""" % (-2.6 * size, 1.8 * size, "\n".join(shapes), 3 * size, 0.3 * size, 3 * size)
    path = os.path.join(folder, "forest.xml")
    with open(path, "w") as file:
        file.write(text)
    return path, triangles


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ambilux", default="build/ambilux")
    parser.add_argument("--backend", default="auto")
    parser.add_argument("--out", default="out/instances")
    parser.add_argument("--rows", type=int, default=96)
    parser.add_argument("--places", type=int, default=64)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--only", choices=("shared", "copied"))
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    scene, triangles = write_scene(args.out, args.rows, args.places)
    print("%s: %d places of %d triangles" % (scene, args.places, triangles))
    if args.write:
        return
    rates = {}
    for name, copies in (("shared", "1"), ("copied", "1000G")):
        if args.only and args.only != name:
            continue
        limits = ["--limits", "copies=" + copies, "--limits", "total_bytes=200G"]
        run = lambda *words: json.loads(subprocess.run([args.ambilux, *words, *limits], check=True, stdout=subprocess.PIPE,
                                                       text=True).stdout)
        info = run("info", scene, "--json", "-")
        rows = run("bench", "rays", scene, "--backend", args.backend, "--repetitions", str(args.repetitions), "--json",
                   "-")
        print("%s: scene %.1f MB, structure %.1f MB built in %.2f s" %
              (name, info["memory_bytes"] / 1e6, rows["accel_bytes"] / 1e6, rows["build_seconds"]))
        rates[name] = {(r["batch"], r["kernel"], r["tuning"]): r["mrays_per_s"] for r in rows["rows"]}
    if len(rates) < 2:
        print(json.dumps({str(k): v for r in rates.values() for k, v in r.items()}, indent=1))
        return
    print("%-44s %12s %12s %8s" % ("batch, kernel, tuning", "shared", "copied", "ratio"))
    for key, copied in rates["copied"].items():
        shared = rates["shared"][key]
        print("%-44s %8.1f M/s %8.1f M/s %8.2f" % (", ".join(key), shared, copied, shared / copied if copied else 0))


if __name__ == "__main__":
    main()
