"""Stages that are no experiment: commands of the program, and the tables that their JSON makes.

A part is (file, command); "ambilux" at its beginning stands for the program. A table is {"columns": [...], "rows": [[...]]} of texts
and numbers (data.py). What was not run, such as a scene that is not there, is not in its table. Needs the standard library alone.
"""

import math
import re

PUBLISHED = ("cornell-box", "veach-mis", "veach-bidir", "living-room", "staircase", "veach-ajar", "water-caustic")
QUICK = ("cornell", "glass")
METHODS = {
    "path": ("-i", "path"),
    "lvc, 1 connection": ("-i", "bdpt", "--variant", "lvc", "--set", "connections=1"),
    "lvc, 3 connections": ("-i", "bdpt", "--variant", "lvc"),
    "wavefront": ("-i", "bdpt"),
    "streaming": ("-i", "bdpt", "--variant", "streaming"),
    "megakernel": ("-i", "bdpt", "--variant", "megakernel"),
}
HD = ("--size", "1920x1080", "--max-depth", "8")
SMALL = ("--size", "64x48", "--max-depth", "4")
GLASS = "scenes/glass.xml"
TURNS = 3


def scenes_of(place, names=PUBLISHED):
    return [(name, path) for name in (QUICK if place.quick else names) if (path := place.scene(name))]


def slug(*words):
    return re.sub(r"[^\w.]+", "-", "_".join(words)) + ".json"


def ambilux(*words):
    return ["ambilux", *words, "--json", "-"]


def table(columns, rows):
    return {"columns": list(columns), "rows": [list(row) for row in rows]}


def by_scene(results, kind, columns, cells):
    """A row for each scene of which results of `kind` are there. cells(of) makes it from of(key), the result or None."""
    names = list(dict.fromkeys(r["scene"] for r in results if r["kind"] == kind))
    rows = []
    for name in names:
        found = {r["key"]: r["json"] for r in results if r["kind"] == kind and r["scene"] == name}
        rows.append([name, *cells(found.get)])
    return table(["scene", *columns], rows)


def part(kind, scene, key, command):
    """Of one result of by_scene."""
    return {"kind": kind, "scene": scene, "key": key, "file": slug(kind, scene, key), "command": command}


def rates(bench):
    """{batch: millions of rays a second}, by the faster kernel."""
    found = {}
    for row in bench["rows"]:
        found[row["batch"]] = max(found.get(row["batch"], 0), row["mrays_per_s"])
    return found


def harmonic(*values):
    return len(values) / sum(1 / v for v in values)


# Rays alone

def rays(place):
    more = ("--repetitions", "2") if place.quick else ()
    for name, path in scenes_of(place):
        for key, words in (("opaque", ("--opaque",)), ("masks", ())):
            yield part("rays", name, key, ambilux("bench", "rays", path, "--backend", place.backend, *words, *more))


OPAQUE, ALL = ("primary", "bounce 1", "bounce 3", "shadow"), ("bounce 1", "bounce 3", "shadow", "to emitters", "from emitters")


def rays_tables(results):
    def alone(of):
        bench = of("opaque")
        found = rates(bench)
        return [f"{bench['accel_bytes'] / 1e6:.3g} MB, {bench['build_seconds']:.2f} s", *(found.get(b) for b in OPAQUE)]
    return {"opaque": by_scene(results, "rays", ("structure: size, build time", *OPAQUE), alone),
            "masks": by_scene(results, "rays", ALL, lambda of: [rates(of("masks")).get(b) for b in ALL])}


# Renders over the time of their rays

def stages(place):
    more = (*SMALL, "--spp", "4") if place.quick else ("--spp", "64")
    for name, path in scenes_of(place):
        rays_more = ("--repetitions", "2") if place.quick else ()
        yield part("stages", name, "rays", ambilux("bench", "rays", path, "--backend", place.backend, *rays_more))
        for method, words in METHODS.items():
            yield part("stages", name, method, ambilux("bench", "stages", path, "--backend", place.backend, *words, *more))


def floor(render, found, bidirectional):
    """Seconds of all rays of a render at the rates of `bench rays` (docs/performance.md has the rule)."""
    extend = harmonic(found["bounce 1"], found["bounce 3"])
    shadow = harmonic(found["to emitters"], found.get("to emitters 3", found["to emitters"]))
    occlude = render["rays"]["occlude"]
    at_shadow = occlude / 2 if bidirectional else 0
    return (render["rays"]["extend"] / extend + (occlude - at_shadow) / shadow + at_shadow / found["shadow"]) / 1e6


def stages_tables(results):
    def cells(of):
        found = rates(of("rays"))
        for method in METHODS:
            render = of(method)
            seconds = render["seconds"]["render"] if render else 0
            yield f"{seconds:.3g} ({seconds / floor(render, found, method != 'path'):.2f})" if render else None
    return {"floor": by_scene(results, "stages", METHODS, cells)}


# One sample, and iterations

def frames(place):
    size = SMALL if place.quick else HD
    for name, path in scenes_of(place, ("cornell-box", "veach-ajar")):
        for method, words in METHODS.items():
            if method != "megakernel":
                yield part("frames", name, method, ambilux("bench", "frames", path, "--backend", place.backend, *size, *words,
                                                           "--memory", "4G", "--frames", "3" if place.quick else "30"))


def frames_tables(results):
    rows = [[r["scene"], r["key"], f"{r['json']['frames_per_second']:.0f}", f"{1000 * r['json']['percentile_95_seconds']:.1f}",
             str(r["json"]["memory_bytes_peak"] >> 20)] for r in results if r["kind"] == "frames"]
    return {"frames": table(["scene", "method", "images per second", "95th percentile, ms", "peak MiB"], rows) | {"grouped": True}}


WAVES = ("path", "wavefront", "lvc, 1 connection", "streaming")


def waves(place):
    size, spp = (SMALL, "4") if place.quick else (HD, "32")
    for name, path in scenes_of(place):
        for method in WAVES:
            yield part("waves", name, method, ambilux("--quiet", "render", path, "--backend", place.backend, *size, "--spp", spp,
                                                      *METHODS[method], "-o", "OUT/image.exr"))


def waves_tables(results):
    def cells(of):
        found = [of(m) for m in WAVES]
        return [*(r["spp"] / r["seconds"]["render"] for r in found), ", ".join(f"{r['memory_bytes_peak'] / 1e9:.1f}" for r in found)]
    return {"waves": by_scene(results, "waves", (*WAVES, "GB: path, wavefront, lvc, streaming"), cells)}


# Builders of structures

def builders(place):
    good, fast = ("cpu-cwbvh", "cpu-fast") if place.quick else ("cuda", "cuda-fast")
    triangles, more = ("20000", ("--repetitions", "2")) if place.quick else ("10000000", ())
    yield part("make", "sphere", "scene", ["python3", "scripts/bench/make_sphere.py", "OUT/sphere.xml", triangles])
    for name, path in [("sphere", "OUT/sphere.xml"), *scenes_of(place, (*PUBLISHED[2:], "glass-and-ice"))]:
        for key, backend in (("good", good), ("fast", fast)):
            yield part("builders", name, key, ambilux("bench", "rays", path, "--backend", backend, *more))


def ratios_of_rates(before, after):
    """Mean and least, as texts, of the rates of two structures, batch by batch."""
    before, after = rates(before), rates(after)
    ratios = {batch: after[batch] / rate for batch, rate in before.items() if rate > 0 and after.get(batch, 0) > 0}
    least = min(ratios, key=ratios.get)
    mean = math.exp(sum(map(math.log, ratios.values())) / len(ratios))
    return f"{mean:.2f}", f"{ratios[least]:.2f} {least}"


def builders_tables(results):
    def cells(of):
        good, fast = of("good"), of("fast")
        return [good["build_seconds"], fast["build_seconds"], *ratios_of_rates(good, fast)]
    columns = ("good: build in s", "fast: build in s", "ratio of rates, mean", "minimum")
    return {"builders": by_scene(results, "builders", columns, cells)}


# OptiX

def optix(place):
    more = ("--repetitions", "2") if place.quick else ()
    for name, path in scenes_of(place):
        for key, backend in (("own", "cpu-cwbvh"), ("optix", "cpu-bvh2")) if place.quick else (("own", "cuda"), ("optix", "cuda-optix")):
            yield part("optix", name, key, ambilux("bench", "rays", path, "--backend", backend, *more))


def optix_tables(results):
    def cells(of):
        own, other = of("own"), of("optix")
        return [*(f"{x['accel_bytes'] / 1e6:.3g} MB, {x['build_seconds']:.2f} s" for x in (own, other)), *ratios_of_rates(own, other)]
    return {"rates": by_scene(results, "optix", ("cwbvh: size, build time", "OptiX: size, build time", "ratio of rates, mean", "minimum"), cells)}


# Several devices

def devices(place):
    device = ("--backend", "cpu") if place.quick else ("--backend", "cuda", "--devices", "0")
    every = ("--devices", "cpu,cpu") if place.quick else ("--backend", "cuda", "--devices", "ALL")
    size = ("--size", "64x36") if place.quick else ("--size", "1920x1080")
    spp = {"path": 8192, "bdpt": 2048}
    for method, samples in spp.items():
        samples = str(64 if place.quick else samples)
        for turn in ("1", "2"):
            for key, words in (("plain", device[:2]), ("ranges", (*device, "--range-size", "16" if place.quick else "256")), ("all", every)):
                yield part("devices", f"{method}, {samples} samples", f"{key} {turn}",
                           ambilux("--quiet", "render", GLASS, *size, "-i", method, "--spp", samples, *words, "-o", "OUT/image.exr"))
    same = ("--spp", "32", "-i", "bdpt", "--deterministic", "--size", "64x36", "--range-size", "16")
    for key, words in (("one", device), ("every", every)):
        yield part("bits", "one", key, ambilux("--quiet", "render", GLASS, *same, *words, "-o", f"OUT/{key}.exr"))
    yield part("bits", "one", "compare", ambilux("compare", "OUT/one.exr", "OUT/every.exr"))


def devices_tables(results):
    def cells(of):
        plain, ranges, every = [[of(f"{key} {turn}")["seconds"]["render"] for turn in (1, 2)] for key in ("plain", "ranges", "all")]
        count = len(of("all 1").get("workers", [])) or 1
        return [min(plain), ", ".join(f"{s:.2f}" for s in ranges), count, ", ".join(f"{s:.2f}" for s in every), f"{min(plain) / (count * min(every)):.2f}"]
    columns = ("plain, s", "by ranges, one device, s", "number of devices", "all devices, s", "efficiency")
    compared = [r["json"] for r in results if r["key"] == "compare"]
    of_renders = by_scene(results, "devices", columns, cells)
    return {"devices": of_renders | {"columns": ["render", *columns]},
            "bits": table(["deterministic images of one device and of all", "RMSE between them"], [[GLASS, c["rmse"]] for c in compared])}


def textures(place):
    size, spp = (SMALL, "4") if place.quick else (HD, "64")
    textures, side = ("1", "256") if place.quick else ("4", "8192")
    wall = f"a wall of {int(textures) * int(side)**2 * 4 >> 20} MiB of textures read at random"
    yield part("make", "wall", "scene", ["python3", "scripts/bench/make_wall.py", "OUT/wall.xml", textures, side])
    for name, path in [(wall, "OUT/wall.xml"), *scenes_of(place, ("living-room", "staircase"))]:
        for where in ("device",) if place.quick else ("device", "host", "pinned"):
            for turn in range(1, TURNS + 1):
                yield part("textures", name, f"{where} {turn}", ambilux("--quiet", "render", path, "--backend", place.backend, *size,
                                                                        "--textures", where, "--spp", spp, "-o", "OUT/image.exr"))


def textures_tables(results):
    def cells(of):
        for where in ("device", "host", "pinned"):
            found = [r["seconds"]["render"] for turn in range(1, TURNS + 1) if (r := of(f"{where} {turn}"))]
            yield f"{min(found):.3g} to {max(found):.3g}" if found else None
    return {"textures": by_scene(results, "textures", ("device", "host", "pinned"), cells)}


# A simulation

RENDERS = {
    "60 s": ("60", "32"), "600 s": ("600", "128"), "10 h": ("36000", "16384"),
    "10 h, `--block-films 1`": ("36000", "16384", "--block-films", "1"),
    "10 h, network of 1.2 GB/s": ("36000", "16384", "--network", "1.2e9"),
    "10 h, network of 1.2 GB/s, `--block-films 1`": ("36000", "16384", "--network", "1.2e9", "--block-films", "1"),
    "10 h, one rank per device": ("36000", "16384", "--per-rank", "1"),
    "10 h, one rank per device, `--block-films 1`": ("36000", "16384", "--per-rank", "1", "--block-films", "1"),
}
DEVICES = ("8", "64", "512")


def model(place):
    shown = list(RENDERS.items())
    for name, (seconds, ranges, *more) in shown[:2] if place.quick else shown:
        yield part("model", name, ranges, ["python3", "scripts/bench/scaling_model.py", "--render-seconds", seconds, "--ranges", ranges,
                                           *more, "--devices", *DEVICES])


def model_tables(results):
    rows = []
    for r in results:
        found = dict(re.findall(r"^\| (\d+) \| [\d.]+ \| ([\d.]+) \|", r["json"]["text"], re.M))
        rows.append([r["scene"], r["key"], *(f"{float(found[d]):.2f}" if float(found[d]) <= 1 and int(d) <= int(r["key"]) else None for d in DEVICES)])
    return {"model": table(["render on one device", "ranges", *(f"{d} devices" for d in DEVICES)], rows)}


# On a CPU

PLAIN = ("--variant", "megakernel")  # on a CPU: a loop that calls the same functions
LOOPS = {"bdpt": (("-i", "bdpt"), ("-i", "bdpt", *PLAIN)),
         "path": (("-i", "path"), ("-i", "bdpt", *PLAIN, "--set", "strategies=hits+next_event"))}


def cpu(place):
    size = ("--size", "64x64", "--spp", "4") if place.quick else ("--size", "256x256", "--spp", "32")
    for name in QUICK if place.quick else ("cornell", "glass", "lights", "materials"):
        for method, loops in LOOPS.items():
            for key, words in zip(("waves", "loop"), loops):
                yield part("stages", name, f"{method} {key}", ambilux("bench", "stages", f"scenes/{name}.xml", "--backend", "cpu", *words, *size))
    repetitions = ("--repetitions", "1" if place.quick else "9")
    for name, path in scenes_of(place, ("cornell-box", "living-room")):
        for key in ("cpu", "cpu-single"):
            yield part("packets", name, key, ambilux("bench", "rays", path, "--backend", key, "--opaque", *repetitions))


SHARES = ("extend", "occlude", "connect", "shade")


def cpu_tables(results):
    def shares(of):
        found = {s["name"]: s["seconds"] for s in of("path waves")["stages"]}
        return [f"{100 * found[s] / sum(found.values()):.0f} %" if s in found else None for s in SHARES]

    def loops(of):
        return [f"{of(f'{m} loop')['seconds']['render'] / of(f'{m} waves')['seconds']['render']:.2f}" for m in LOOPS]

    def packets(of):
        fast, single = rates(of("cpu")), rates(of("cpu-single"))
        return [f"{fast[b] / single[b]:.2f}" if b in fast and b in single else None for b in OPAQUE]
    return {"shares": by_scene(results, "stages", SHARES, shares), "loop": by_scene(results, "stages", LOOPS, loops),
            "packets": by_scene(results, "packets", OPAQUE, packets)}
