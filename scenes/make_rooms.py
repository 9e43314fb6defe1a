"""Writes a scene of many lamps of all kinds in a row of rooms, where most lamps light one room alone.

Usage: python scenes/make_rooms.py OUT.xml [--lamps 10000] [--rooms 100] [--seed 1]
Everything follows from the numbers given, so running it again writes the same scene.
"""

import argparse
import math
import random
from pathlib import Path

WIDTH, HEIGHT, DEPTH = 4.0, 3.0, 5.0  # of a room along x, y and z
DOOR_WIDTH, DOOR_HEIGHT = 1.2, 2.2
KINDS = ("rectangle", "sphere", "disk", "cylinder", "cube", "point", "spot", "collimated", "hiddenarea")
SHARES = (25, 20, 15, 8, 8, 12, 10, 1, 1)  # percent


def text(*values):
    return ", ".join(f"{v:.5g}" for v in values)


def rgb(name, color):
    return f'<rgb name="{name}" value="{text(*color)}"/>'


def looking(origin, target, size=1.0):
    x, y, z = (abs(a - b) for a, b in zip(origin, target))
    up = (0, 1, 0) if x + z > 0.1 * y else (0, 0, 1)  # not along the way
    return f'<transform name="to_world"><scale value="{size:.5g}"/><lookat origin="{text(*origin)}" target="{text(*target)}" up="{text(*up)}"/></transform>'


def panel(center, half_size, facing, bsdf):
    """A rectangle with two sides, across the axis `facing`."""
    turn = {"x": '<rotate y="1" angle="90"/>', "y": '<rotate x="1" angle="-90"/>', "z": ""}[facing]
    return (f'<shape type="rectangle"><transform name="to_world"><scale x="{half_size[0]:.5g}" y="{half_size[1]:.5g}"/>{turn}'
            f'<translate x="{center[0]:.5g}" y="{center[1]:.5g}" z="{center[2]:.5g}"/></transform><ref id="{bsdf}"/></shape>')


def shell(rooms):
    """Floor, ceiling, long walls, ends, and walls with a door between rooms."""
    middle, half = rooms * WIDTH / 2, rooms * WIDTH / 2
    yield panel((middle, 0, 0), (half, DEPTH / 2), "y", "floor")
    yield panel((middle, HEIGHT, 0), (half, DEPTH / 2), "y", "wall")
    for side in (-1, 1):
        yield panel((middle, HEIGHT / 2, side * DEPTH / 2), (half, HEIGHT / 2), "z", "wall")
    jamb = (DEPTH - DOOR_WIDTH) / 2
    for i in range(rooms + 1):
        x = i * WIDTH
        if i in (0, rooms):
            yield panel((x, HEIGHT / 2, 0), (DEPTH / 2, HEIGHT / 2), "x", "wall")
            continue
        for side in (-1, 1):
            yield panel((x, HEIGHT / 2, side * (DOOR_WIDTH + jamb) / 2), (jamb / 2, HEIGHT / 2), "x", "wall")
        yield panel((x, (HEIGHT + DOOR_HEIGHT) / 2, 0), (DOOR_WIDTH / 2, (HEIGHT - DOOR_HEIGHT) / 2), "x", "wall")
    for i in range(rooms):  # something to cast shadows
        x = (i + 0.5) * WIDTH
        yield (f'<shape type="cube"><transform name="to_world"><scale x="0.4" y="0.4" z="0.4"/><rotate y="1" angle="{37 * i % 90}"/>'
               f'<translate x="{x:.5g}" y="0.4" z="{1.4 if i % 2 else -1.4}"/></transform><ref id="body"/></shape>')


def lamp(kind, at, towards, size, power, color):
    """A lamp that sends about `power` watts."""
    def lit(area, plugin="area"):
        return f'<emitter type="{plugin}">{rgb("radiance", [c * power / (math.pi * area) for c in color])}</emitter>'

    def scaled(value):
        return [c * value for c in color]

    center = f'<point name="{{}}" x="{at[0]:.5g}" y="{at[1]:.5g}" z="{at[2]:.5g}"/>'
    if kind == "rectangle":
        return f'<shape type="rectangle">{looking(at, towards, size)}<ref id="black"/>{lit(4 * size * size)}</shape>'
    if kind == "hiddenarea":
        return f'<shape type="rectangle">{looking(at, towards, size)}<bsdf type="null"/>{lit(4 * size * size, "hiddenarea")}</shape>'
    if kind == "disk":
        return f'<shape type="disk">{looking(at, towards, size)}<ref id="black"/>{lit(math.pi * size * size)}</shape>'
    if kind == "cube":
        return f'<shape type="cube">{looking(at, towards, 0.5 * size)}<ref id="black"/>{lit(6 * size * size)}</shape>'
    if kind == "sphere":
        return f'<shape type="sphere">{center.format("center")}<float name="radius" value="{size:.5g}"/><ref id="black"/>{lit(4 * math.pi * size * size)}</shape>'
    if kind == "cylinder":
        end = f'<point name="p1" x="{at[0]:.5g}" y="{at[1]:.5g}" z="{at[2] + 4 * size:.5g}"/>'
        return f'<shape type="cylinder"><float name="radius" value="{0.3 * size:.5g}"/>{center.format("p0")}{end}<ref id="black"/>{lit(2 * math.pi * 0.3 * 4 * size * size)}</shape>'
    if kind == "point":
        return f'<emitter type="point">{center.format("position")}{rgb("intensity", scaled(power / (4 * math.pi)))}</emitter>'
    if kind == "spot":
        return (f'<emitter type="spot">{rgb("intensity", scaled(power / (2 * math.pi * 0.2)))}<float name="cutoff_angle" value="40"/>'
                f'<float name="beam_width" value="30"/>{looking(at, towards)}</emitter>')
    return f'<emitter type="collimated">{rgb("power", scaled(0.1 * power))}{looking(at, towards)}</emitter>'


def lamps(count, rooms, rng):
    for i in range(count):
        room = i % rooms
        at = (WIDTH * (room + rng.uniform(0.05, 0.95)), rng.uniform(0.3, 0.97) * HEIGHT, rng.uniform(-0.47, 0.47) * DEPTH)
        towards = (at[0] + rng.uniform(-1, 1), 0 if rng.random() < 0.8 else HEIGHT, at[2] + rng.uniform(-1, 1))
        kind = rng.choices(KINDS, SHARES)[0]
        color = [0.5 + 0.5 * rng.random() for _ in range(3)]
        yield lamp(kind, at, towards, math.exp(rng.uniform(-5.0, -3.5)), math.exp(rng.gauss(-1.0, 1.0)), color)


def scene(count, rooms, seed):
    rng = random.Random(seed)
    x = (rooms // 2 + 0.08) * WIDTH
    yield '<?xml version="1.0" encoding="utf-8"?>'
    yield f"<!-- {count} lamps in {rooms} rooms; written by scenes/make_rooms.py, seed {seed}. -->"
    yield '<scene version="3.0.0"><default name="spp" value="64"/>'
    yield '<integrator type="path"><integer name="max_depth" value="5"/></integrator>'
    yield f'<sensor type="perspective"><float name="fov" value="75"/>{looking((x, 1.6, 1.5), (x + WIDTH, 1.3, -0.6))}'
    yield '<film type="hdrfilm"><integer name="width" value="320"/><integer name="height" value="240"/><rfilter type="tent"/></film>'
    yield '<sampler type="independent"><integer name="sample_count" value="$spp"/></sampler></sensor>'
    for name, color in (("floor", (0.45, 0.35, 0.25)), ("wall", (0.6, 0.6, 0.58)), ("body", (0.3, 0.45, 0.6)), ("black", (0, 0, 0))):
        yield f'<bsdf type="twosided" id="{name}"><bsdf type="diffuse">{rgb("reflectance", color)}</bsdf></bsdf>'
    yield from shell(rooms)
    yield from lamps(count, rooms, rng)
    yield "</scene>"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--lamps", type=int, default=10000)
    parser.add_argument("--rooms", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.lamps < 0 or arguments.rooms < 1:
        parser.error("there must be one room at least, and lamps cannot be fewer than none")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text("\n".join(scene(arguments.lamps, arguments.rooms, arguments.seed)) + "\n")


if __name__ == "__main__":
    main()
