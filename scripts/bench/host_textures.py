#!/usr/bin/env python3
"""What textures in host memory cost (docs/scaling.md): renders a wall of large textures, and prints times in turns.

    scripts/bench/host_textures.py PROGRAM [--textures N] [--side PIXELS] [--left MIB] [--values device pinned]

Every pixel of the wall sees texels from anywhere, the worst case for pages: textures are much finer than the image.
First the device has room for all textures; then another process takes its memory until --left is left. On a shared
device leave `host` out there: more managed memory than a device has free can stop it for others too.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile


def write_scene(folder, textures, side):
    columns = round(textures**0.5)
    rows = (textures + columns - 1) // columns
    shapes = ""
    for i in range(textures):
        with open(folder / f"{i}.ppm", "wb") as file:
            file.write(b"P6\n%d %d\n255\n" % (side, side))
            for _ in range(side):
                file.write(os.urandom(3 * side))
        x, y = 2 * (i % columns) - columns + 1, 2 * (i // columns) - rows + 1
        shapes += f"""<shape type="rectangle"><transform name="to_world"><translate x="{x}" y="{y}"/></transform>
            <bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" value="{i}.ppm"/></texture></bsdf></shape>\n"""
    path = folder / "wall.xml"
    path.write_text(f"""<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="4"/></integrator>
        <sensor type="perspective"><float name="fov" value="60"/><transform name="to_world">
        <lookat origin="0,0,{columns * 1.8}" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="1024"/><integer name="height" value="1024"/></film></sensor>
        <emitter type="constant"/>{shapes}</scene>""")
    return path


def render(program, scene, folder, textures, spp):
    """Seconds, bytes on the device and the error against the first image; or why it was refused."""
    out, first, stats = folder / "out.exr", folder / "first.exr", folder / "stats.json"
    command = [program, "--quiet", "render", scene, "-o", out, "--json", stats, "--backend", "cuda", "--textures", textures, "--spp", spp, "--deterministic"]
    done = subprocess.run([str(c) for c in command], stderr=subprocess.PIPE, text=True)
    if done.returncode:
        return done.stderr.strip()
    told = json.loads(stats.read_text())
    if not first.exists():
        out.rename(first)
        return told["seconds"], told["memory_bytes"], 0.0
    compared = subprocess.run([program, "compare", out, first, "--json", "-"], stdout=subprocess.PIPE, text=True, check=True)
    return told["seconds"], told["memory_bytes"], json.loads(compared.stdout)["rmse"]


def report(program, scene, folder, spp, turns, values, what):
    """Prints each render as it ends: a machine that is lent for minutes may be gone before the last."""
    print(f"\n{what}\n\n| textures | turn | load s | build s | render s | MiB on the device | RMSE against the first |\n| --- | --- | --- | --- | --- | --- | --- |", flush=True)
    for turn in range(1, turns + 1):
        for textures in values:
            result = render(program, scene, folder, textures, spp)
            if isinstance(result, str):
                print(f"| {textures} | {turn} | {result} | | | | |", flush=True)
                continue
            seconds, memory, rmse = result
            print(f"| {textures} | {turn} | {seconds['load']:.2f} | {seconds['build']:.2f} | {seconds['render']:.3f} | {memory >> 20} | {rmse} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--textures", type=int, default=9)
    parser.add_argument("--side", type=int, default=8192, help="pixels; a texture has 4 bytes for each")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--values", nargs="+", choices=("device", "host", "pinned"), default=("device", "host", "pinned"), help="of the setting textures")
    parser.add_argument("--left", type=int, help="MiB that are left on the device in the second part; default: 1024 more than half of the textures")
    a = parser.parse_args()
    texels = a.textures * a.side**2 * 4 >> 20
    left = a.left or 1024 + texels // 2
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene = write_scene(folder, a.textures, a.side)
        report(a.program, scene, folder, a.spp, a.turns, a.values, f"{texels} MiB of textures, a device with room for them")
        holder = subprocess.Popen([sys.executable, pathlib.Path(__file__).with_name("hold_device_memory.py"), str(left)], stdin=subprocess.PIPE,
                                  stdout=subprocess.PIPE, text=True)
        try:
            held = holder.stdout.readline().strip()
            if not held:
                sys.exit("the device's memory could not be taken: see above")
            report(a.program, scene, folder, a.spp, a.turns, a.values, f"{texels} MiB of textures; of the device's memory {held}")
        finally:
            holder.stdin.close()
            holder.wait()


if __name__ == "__main__":
    main()
