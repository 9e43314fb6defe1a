"""LuxCore as a peer of an experiment."""

import array
import ctypes
import importlib.util
import json
import math
import os
import sys
import time
from pathlib import Path

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import kernel_build
import mitsuba_scene
from peer_protocol import Missing, Refused, serve

# Seconds until the kernels are built and have made a first sample.
LIMIT = float(os.environ.get("AMBILUX_LUXCORE_KERNEL_SECONDS") or 600)
# Seconds without a further sample, once there are kernels.
SILENCE = 60.0
KINDS = ("CUDA_GPU", "OPENCL_GPU", "OPENCL_CPU")
BUILD = "--build-kernels"


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
    return {"renderengine.type": job["integrator"], "sampler.type": "SOBOL", "sampler.sobol.adaptive.strength": 0.0,
            "film.width": width, "film.height": height, "film.filter.type": "NONE", "film.outputs.0.type": "RGB", "film.outputs.0.filename": "none.exr",
            "film.imagepipelines.0.0.type": "NOP", "path.clamping.variance.maxvalue": 0.0, "path.forceblackbackground.enable": False,
            "path.pathdepth.total": depth, "path.pathdepth.diffuse": depth, "path.pathdepth.glossy": depth, "path.pathdepth.specular": depth,
            "path.russianroulette.depth": roulette, "path.maxdepth": depth, "light.maxdepth": depth}


def choose_device(lc):
    """(name, kind, settings) of the one device that PATHOCL uses: the same card may be there as a CUDA and as an OpenCL device. None without any."""
    devices = lc.GetOpenCLDeviceDescs()
    kinds = []
    while (key := f"opencl.device.{len(kinds)}.type") in devices.GetAllNames():
        kinds.append(devices.Get(key).GetString())
    for kind in KINDS:
        if kind in kinds:
            chosen = kinds.index(kind)
            settings = {"opencl.devices.select": "".join("1" if i == chosen else "0" for i in range(len(kinds))), "opencl.native.threads.count": 0,
                        # Our traversal is CUDA's too. LuxCore makes a context of OptiX unless this says 0, and dies where that library is missing.
                        "cuda.optix.devices.select": "0" * len(kinds), "accelerator.type": "BVH", "film.opencl.enable": False}
            if kind == "OPENCL_CPU":
                settings["opencl.task.count"] = 8192  # 512 Ki are for a device
            return devices.Get(f"opencl.device.{chosen}.name").GetString(), kind, settings
    return None


def with_one_allocator():
    """pyluxcore brings an allocator, and drivers are loaded behind it (OpenCL's for every engine). Unless it was there first, they free what the other
    one gave and end the process: start again with it."""
    found = importlib.util.find_spec("pyluxcore")
    if not found or not found.origin:
        return
    libraries = sorted(str(path) for path in (Path(found.origin).parents[1] / "pyluxcore.libs").glob("libtbbmalloc*"))
    loaded = os.environ.get("LD_PRELOAD", "")
    if not libraries or libraries[0] in loaded:
        return
    os.environ["LD_PRELOAD"] = ":".join([*libraries, *filter(None, [loaded])])
    os.execv(sys.executable, [sys.executable, "-u", *sys.argv])


def load_nvrtc():
    """LuxCore looks for the compiler by name. A toolkit's own, which the loader may not find, is then already there."""
    for folder in filter(None, (os.environ.get("CUDA_HOME"), os.environ.get("CUDA_PATH"), "/usr/local/cuda")):
        for path in sorted((Path(folder) / "lib64").glob("libnvrtc.so.*")):
            try:
                return ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
            except OSError:
                continue
    return None


class Session:
    """A session that renders until enough samples are counted."""

    def __init__(self, lc, scene, settings, size):
        self.lc, self.scene, self.settings, (self.width, self.height) = lc, scene, settings, size
        self.session = None

    def run(self, seed):
        if self.session:
            return self.session.Resume()
        config = self.lc.RenderConfig(properties_of(self.lc, {**self.settings, "renderengine.seed": max(1, seed)}), self.scene)
        self.session = self.lc.RenderSession(config)
        self.session.Start()

    def counted(self):
        """Samples a pixel."""
        self.session.UpdateStats()
        return self.session.GetStats().Get("stats.renderengine.total.samplecount").GetFloat() / (self.width * self.height)

    def wait(self, samples, before):
        """Until `samples` more than `before` are counted: what is counted then, and when."""
        begin = heard = time.perf_counter()
        last = before
        while True:
            count, now = self.counted(), time.perf_counter()
            if count >= before + samples:
                return count, now
            if count > last:
                last, heard = count, now
            if now - heard > SILENCE:
                raise Refused(f"no further sample in {SILENCE:g} s: {last - before:g} of {samples:g}")
            # Half of what is left, so that few samples are made beyond.
            rate = (count - before) / (now - begin)
            time.sleep(min(0.02, max(0.0005, 0.5 * (before + samples - count) / rate if rate > 0 else 0.001)))

    def image(self):
        import numpy as np

        buffer = array.array("f", [0.0]) * (self.width * self.height * 3)
        self.session.GetFilm().GetOutputFloat(self.lc.FilmOutputType.RGB, buffer, 0, True)
        return np.frombuffer(buffer, dtype=np.float32).reshape(self.height, self.width, 3)[::-1]


def pass_of_threads(session, seed, samples):
    begin = time.perf_counter()
    if session.session is None:
        session.run(seed)
        begin = time.perf_counter()
    else:
        session.run(seed)
    session.wait(samples, 0.0)
    session.session.Pause()
    seconds = time.perf_counter() - begin
    done = session.counted()
    image = session.image()
    session.session.GetFilm().Clear()
    return image, seconds, max(1, round(done))


def pass_of_kernels(session, seed, samples):
    """Between two of the films that the device hands over: it does so only now and then, sees the end of a pause late, and works on behind its beginning.
    Its film cannot be cleared: a pass is a difference of sums."""
    earlier = session.counted() if session.session else 0.0
    session.run(seed)
    first, begin = session.wait(1e-9 + earlier * 1e-9, earlier)
    start_image = session.image()
    last, end = session.wait(samples, first)
    image = session.image()
    session.session.Pause()
    done = last - first
    return (image.astype("float64") * last - start_image.astype("float64") * first) / done, end - begin, max(1, round(done)), True


def start(job, build=True):
    try:
        # NumPy comes first: pyluxcore replaces the allocator, and what is loaded behind it frees memory that the other one gave.
        import numpy as np  # noqa: F401
        import luxcore_scene
        import pyluxcore as lc
    except ImportError as error:
        raise Missing(f"pyluxcore cannot be imported by {sys.executable} ({error}); AMBILUX_PEERS_PYTHON names another Python") from error

    if job["integrator"] == "PATHOCL" and not importlib.util.find_spec("nvidia"):
        load_nvrtc()
    lc.Init(lambda message: print(message.strip(), file=sys.stderr, flush=True))
    sums = job["integrator"] == "PATHOCL"  # kernels keep films of their own, which a cleared film of the session does not clear
    device = choose_device(lc) if sums else None
    if sums and not device:
        raise Missing("PATHOCL: LuxCore finds no CUDA or OpenCL device")
    job = {**job, "integrator": "path", "engine": job["integrator"]}
    tree, listed = mitsuba_scene.convert(job)
    changes = mitsuba_scene.Changes()
    settings = {**settings_of({**job, "integrator": job["engine"]}), **(device[2] if device else {})}
    properties, meshes = luxcore_scene.convert(tree.getroot(), job["film"], changes)
    scene = lc.Scene()
    for name, (points, triangles, normals) in meshes.items():
        scene.DefineMesh(name, [tuple(p) for p in points.tolist()], [tuple(t) for t in triangles.tolist()],
                         None if normals is None else [tuple(n) for n in normals.tolist()], None, None, None)
    scene.Parse(properties_of(lc, properties))
    width, height = job["film"]
    session = Session(lc, scene, settings, job["film"])
    compile_seconds = 0.0
    if sums and build:
        compile_seconds = kernel_build.run([sys.executable, "-u", os.path.abspath(__file__), sys.argv[1], BUILD], LIMIT, f"LuxCore builds kernels for {device[0]}")

    def render(seed, samples):
        return (pass_of_kernels if sums else pass_of_threads)(session, seed, samples)

    differences = ["passes end when enough samples are counted: some have more than asked for, which is counted",
                   "sampler: LuxCore's Sobol' sequence, whose passes are not independent: there are no batches, and intervals are over seeds",
                   "roulette: LuxCore's own, from the same depth, with a survival of at least 0.5"]
    if sums:
        differences.append("passes are differences of the film's sums, between two films that the device hands over; what it makes between passes is not counted")
    if job["engine"] == "BIDIRCPU":
        differences.append("path lengths: light and eye subpaths are bounded, not their sum")
    where = device[0] if device else f"{os.cpu_count()} threads"
    backend = "cuda" if device and device[1] == "CUDA_GPU" else "opencl" if device else "cpu"
    return {"version": f"LuxCore {lc.Version()}", "device": f"LuxCore {job['engine']}, {where}", "backend": backend, "compile_seconds": compile_seconds,
            "changes": listed + changes.texts(), "differences": differences}, render


def build_kernels(job):
    """A render of one sample: LuxCore and the driver then have the kernels in their caches."""
    global SILENCE
    SILENCE = math.inf  # some drivers build at a kernel's first launch; who started this has the clock
    begin = time.monotonic()
    _, render = start(job, build=False)
    render(1, 1)
    kernel_build.log_line(begin, "first sample")


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        asked = json.load(file)
    with_one_allocator()
    if BUILD in sys.argv:
        build_kernels(asked)
    else:
        serve(start)
    os._exit(0)  # Python's end and LuxCore's log handler are not on good terms
