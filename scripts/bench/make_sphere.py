#!/usr/bin/env python3
"""Writes a scene of a bumpy sphere with about N triangles of similar sizes: scripts/bench/make_sphere.py FILE.xml N (for scripts/evidence.sh)."""

import itertools
import math
import struct
import sys
from array import array
from pathlib import Path

SCENE = """<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0, 0, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="512"/><integer name="height" value="512"/></film></sensor>
    <emitter type="constant"/>
    <shape type="ply"><string name="filename" value="{}"/><bsdf type="diffuse"/></shape>
</scene>
"""


def points(n):
    """Rows of 2 n + 1 points."""
    around = [2 * math.pi * j / (2 * n) for j in range(2 * n + 1)]
    waves = [(math.cos(u), math.sin(u), 0.05 * math.sin(40 * u), 977 * u) for u in around]
    for i in range(n + 1):
        v = 0.01 + (math.pi - 0.02) * i / n
        sine, cosine, large, small, turn = math.sin(v), math.cos(v), math.sin(31 * v), 0.002 * math.sin(811 * v), 3 * v
        row = array("f")
        for cos_u, sin_u, wave, fine in waves:
            radius = 1 + wave * large + small * math.sin(fine + turn)
            row.extend((radius * sine * cos_u, radius * cosine, radius * sine * sin_u))
        yield row


def faces(n):
    """Rows of 4 n faces: a count and three corners each."""
    pack = struct.Struct("<" + "BiiiBiii" * (2 * n)).pack
    for first in range(0, n * (2 * n + 1), 2 * n + 1):
        below = first + 2 * n + 1
        yield pack(*(x for j in range(2 * n) for x in (3, first + j, first + j + 1, below + j, 3, first + j + 1, below + j + 1, below + j)))


def main(path, triangles):
    n = max(2, round(math.sqrt(triangles) / 2))
    mesh = path.with_suffix(".ply")
    with open(mesh, "wb") as file:
        file.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % ((n + 1) * (2 * n + 1)))
        file.write(b"property float x\nproperty float y\nproperty float z\nelement face %d\n" % (4 * n * n))
        file.write(b"property list uchar int vertex_indices\nend_header\n")
        for row in itertools.chain(points(n), faces(n)):
            file.write(row)
    path.write_text(SCENE.format(mesh.name))
    print(f"{4 * n * n} triangles")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
