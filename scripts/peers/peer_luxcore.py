"""LuxCore as a peer of an experiment."""

import array
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import mitsuba_scene
from peer_protocol import Missing, Refused, serve


def properties_of(lc, values):
    properties = lc.Properties()
    for key, value in values.items():
        properties.Set(lc.Property(key, value))
    return properties


def settings_of(job):
    # LuxCore counts bounces, and direct light as one; a segment to the camera is none.
    depth = job["max_depth"] - 1 if job["max_depth"] >= 0 else 1000
    if depth < 1:
        raise Refused("paths of fewer than two segments")
    roulette = max(1, job["rr_depth"]) if job["rr_depth"] >= 0 else 1000000
    width, height = job["film"]
    if job["crop"] != [0, 0, width, height]:
        raise Refused("a crop of the film")
    return {"renderengine.type": job["integrator"], "sampler.type": "RANDOM", "sampler.random.adaptive.strength": 0.0,
            "film.width": width, "film.height": height, "film.filter.type": "NONE", "film.outputs.0.type": "RGB", "film.outputs.0.filename": "none.exr",
            "film.imagepipelines.0.0.type": "NOP", "path.clamping.variance.maxvalue": 0.0, "path.forceblackbackground.enable": False,
            "path.pathdepth.total": depth, "path.pathdepth.diffuse": depth, "path.pathdepth.glossy": depth, "path.pathdepth.specular": depth,
            "path.russianroulette.depth": roulette, "opencl.cpu.use": False, "opencl.native.threads.count": 0, "path.maxdepth": depth, "light.maxdepth": depth}


def device_of(lc, engine):
    if engine != "PATHOCL":
        return f"LuxCore {engine}, {os.cpu_count()} threads"
    return f"LuxCore {engine}, {' + '.join(gpus(lc)) or 'no device'}"


def gpus(lc):
    """Names of the devices that PATHOCL may use: CUDA alone, since the same card is there as an OpenCL device too."""
    devices = lc.GetOpenCLDeviceDescs()
    keys = [k for k in devices.GetAllNames() if k.endswith(".type") and "CUDA_GPU" in devices.Get(k).GetString()]
    return [devices.Get(k[: -len("type")] + "name").GetString() for k in keys]


def start(job):
    try:
        # NumPy comes first: pyluxcore replaces the allocator, and what is loaded behind it frees memory that the other one gave.
        import numpy as np
        import luxcore_scene
        import pyluxcore as lc
    except ImportError as error:
        raise Missing(f"pyluxcore cannot be imported ({error})") from error

    lc.Init(lambda message: print(message, file=sys.stderr))
    if job["integrator"] == "PATHOCL" and not gpus(lc):
        raise Missing("PATHOCL: LuxCore finds no CUDA device")
    job = {**job, "integrator": "path", "engine": job["integrator"]}
    tree, listed = mitsuba_scene.convert(job)
    changes = mitsuba_scene.Changes()
    settings = settings_of({**job, "integrator": job["engine"]})
    properties, meshes = luxcore_scene.convert(tree.getroot(), job["film"], changes)
    scene = lc.Scene()
    for name, (points, triangles, normals) in meshes.items():
        scene.DefineMesh(name, [tuple(p) for p in points.tolist()], [tuple(t) for t in triangles.tolist()],
                         None if normals is None else [tuple(n) for n in normals.tolist()], None, None, None)
    scene.Parse(properties_of(lc, properties))
    width, height = job["film"]
    session = None
    # Kernels keep films of their own, which a cleared film of the session does not clear.
    sums = job["engine"] == "PATHOCL"
    total = 0.0

    def counted():
        session.UpdateStats()
        return session.GetStats().Get("stats.renderengine.total.samplecount").GetFloat() / (width * height)

    def render(seed, samples):
        nonlocal session
        before = counted() if session and sums else 0.0
        begin = time.perf_counter()
        if session is None:
            config = lc.RenderConfig(properties_of(lc, {**settings, "renderengine.seed": max(1, seed)}), scene)
            session = lc.RenderSession(config)
            session.Start()
            begin = time.perf_counter()
        else:
            session.Resume()
        done = 0.0
        while (done := counted() - before) < samples:
            # Half of what is left, so that few samples are made beyond.
            rate = done / (time.perf_counter() - begin)
            time.sleep(min(0.02, max(0.0005, 0.5 * (samples - done) / rate if rate > 0 else 0.001)))
        session.Pause()
        seconds = time.perf_counter() - begin
        done = counted() - before
        buffer = array.array("f", [0.0]) * (width * height * 3)
        session.GetFilm().GetOutputFloat(lc.FilmOutputType.RGB, buffer, 0, True)
        if not sums:
            session.GetFilm().Clear()
        image = np.frombuffer(buffer, dtype=np.float32).reshape(height, width, 3)[::-1]
        samples = max(1, round(done))
        if not sums:
            return image, seconds, samples
        # What this pass brought: the film's mean is of all passes.
        nonlocal total
        total, earlier = image.astype(np.float64) * (before + done), total
        return (total - earlier) / done, seconds, samples, True

    differences = ["passes end when enough samples are counted: some have more than asked for, which is counted",
                   "roulette: LuxCore's own, from the same depth, with a survival of at least 0.5"]
    if sums:
        differences.append("passes are differences of the film's sums")
    if job["engine"] == "BIDIRCPU":
        differences.append("path lengths: light and eye subpaths are bounded, not their sum")
    return {"version": f"LuxCore {lc.Version()}", "device": device_of(lc, job["engine"]), "backend": "cuda" if sums else "cpu", "compile_seconds": 0.0,
            "changes": listed + changes.texts(), "differences": differences}, render


if __name__ == "__main__":
    serve(start)
