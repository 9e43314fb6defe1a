"""Mitsuba 3 as a peer of an experiment."""

import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import mitsuba_scene
from peer_protocol import Missing, serve

# Beside ours. Both choose where a subpath may end by its throughput from rr_depth on and survive with at most 0.95.
DIFFERENCES = {
    "path": [],
    "ptracer": ["light tracing: what mirrors and glass show to the camera is not found"],
}


def parts(samples, scalar):
    """A kernel of Dr.Jit divides by the number of samples, or shifts by its logarithm: powers of two need one kernel."""
    return [samples] if scalar else [1 << bit for bit in reversed(range(samples.bit_length())) if samples >> bit & 1]


def start(job):
    tree, changes = mitsuba_scene.convert(job)  # what it refuses needs no Mitsuba
    try:
        import mitsuba as mi
    except ImportError as error:
        raise Missing(f"mitsuba cannot be imported by {sys.executable} ({error}); AMBILUX_PEERS_PYTHON names another Python") from error
    import drjit as dr
    import numpy as np

    variant = job["variant"]
    try:
        mi.set_variant(variant)
    except ImportError as error:
        raise Missing(f"variant {variant}: {error}") from error
    mi.set_log_level(mi.LogLevel.Error)
    path = os.path.join(job["folder"], "scene.xml")
    tree.write(path, encoding="utf-8", xml_declaration=True)
    scene = mi.load_file(path)
    scalar = variant.startswith("scalar")

    def one(seed, samples):
        image = mi.render(scene, seed=seed, spp=samples)
        if not scalar:
            dr.eval(image)
            dr.sync_thread()
        return image

    def render(seed, samples):
        begin = time.perf_counter()
        images = [(n, one((seed + 0x9E3779B9 * i) & 0xFFFFFFFF, n)) for i, n in enumerate(parts(samples, scalar))]
        seconds = time.perf_counter() - begin
        mean = sum(np.array(image, dtype=np.float64)[:, :, :3] * (n / samples) for n, image in images)
        return mean, seconds

    compile_seconds = 0.0
    if not scalar:
        # Twice each: the first makes the kernels, the second says what a render costs without.
        for samples in (1, 2):
            first, second = render(1, samples)[1], render(2, samples)[1]
            compile_seconds += max(0.0, first - second)
    ready = {"version": f"mitsuba {mi.__version__}", "device": f"Mitsuba {variant}", "backend": "cuda" if variant.startswith("cuda") else "cpu",
             "compile_seconds": compile_seconds, "changes": changes, "differences": DIFFERENCES[job["integrator"]]}
    if ready["backend"] == "cpu":
        ready["device"] += f", {os.cpu_count()} threads"
    return ready, render


if __name__ == "__main__":
    serve(start)
