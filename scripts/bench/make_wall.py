#!/usr/bin/env python3
"""Writes a scene of a wall of large textures: scripts/bench/make_wall.py FILE.xml TEXTURES SIDE (for scripts/evidence.sh).

Every pixel of the wall sees texels from anywhere, the worst case for pages: textures are much finer than the image.
"""

import os
import sys
from pathlib import Path


def main(path, textures, side):
    columns = round(textures**0.5)
    rows = (textures + columns - 1) // columns
    shapes = ""
    for i in range(textures):
        image = path.with_name(f"{path.stem}_{i}.ppm")
        with open(image, "wb") as file:
            file.write(b"P6\n%d %d\n255\n" % (side, side))
            for _ in range(side):
                file.write(os.urandom(3 * side))
        x, y = 2 * (i % columns) - columns + 1, 2 * (i // columns) - rows + 1
        shapes += f"""<shape type="rectangle"><transform name="to_world"><translate x="{x}" y="{y}"/></transform>
            <bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" value="{image.name}"/></texture></bsdf></shape>\n"""
    path.write_text(f"""<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="4"/></integrator>
        <sensor type="perspective"><float name="fov" value="60"/><transform name="to_world">
        <lookat origin="0,0,{columns * 1.8}" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="1024"/><integer name="height" value="1024"/></film></sensor>
        <emitter type="constant"/>{shapes}</scene>""")
    print(f"{textures * side * side * 4 >> 20} MiB of textures")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
