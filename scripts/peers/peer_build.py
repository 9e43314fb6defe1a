"""Another build of Ambilux as a peer of an experiment: its Python package renders, so that two revisions are runs beside each other, in turns."""

import json
import os
import sys
import time
import xml.etree.ElementTree as xml

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from peer_protocol import Missing, Refused, serve


def with_box_filter(path):
    """The text of a scene file whose film has a box filter."""
    root = xml.parse(path).getroot()
    films = list(root.iter("film"))
    for film in films:
        for old in film.findall("rfilter"):
            film.remove(old)
        xml.SubElement(film, "rfilter", {"type": "box"})
    for sensor in [] if films else root.iter("sensor"):
        xml.SubElement(xml.SubElement(sensor, "film", {"type": "hdrfilm"}), "rfilter", {"type": "box"})
    return xml.tostring(root, encoding="unicode")


def start(job):
    sys.path.insert(0, job["module"])
    try:
        import ambilux
        from ambilux import _core
        import numpy as np
    except ImportError as error:
        raise Missing(f"{job['module']}: the package ambilux cannot be imported ({error})") from error
    own = os.path.realpath(_core.__file__)
    if not own.startswith(os.path.realpath(job["module"]) + os.sep):
        raise Refused(f"{job['module']} has no package ambilux: {own} was found instead")
    if not job["scene"].endswith(".xml"):
        raise Refused("the box filter of other formats than Mitsuba's cannot be set from here")
    scene = _core.load(job["scene"], with_box_filter(job["scene"]), list(job["parameters"].items()), tuple(job["film"]), False, False, [])
    if list(scene.size) != job["crop"][2:]:
        raise Refused(f"a film of {scene.size}, not of {job['crop'][2:]} pixels")
    # The settings of the run have the last word, and their own check.
    settings = [("max_depth", str(job["max_depth"])), ("rr_depth", str(job["rr_depth"])), *((k, v) for k, v in job["settings"])]
    exact = hasattr(_core.Render, "add")
    kept = {}

    def in_parts(seed, first, samples):
        """Samples by their numbers: the same, at equal seeds, as of this program's own runs."""
        if first == 0 or seed not in kept:
            kept.clear()
            kept[seed] = _core.Render(scene, [*settings, ("seed", str(seed))], 1 << 31, None)
        core = kept[seed]
        core.clear()
        seconds = core.add(first, samples)
        return core.pixels().rgb, seconds

    def anew(seed, samples):
        """Of older builds: each pass is a render with a seed of its own."""
        core = _core.Render(scene, [*settings, ("seed", str(seed))], samples, None)
        begin = time.perf_counter()
        core.advance(0)
        return core.pixels().rgb, time.perf_counter() - begin

    def render(request):
        samples = request["samples"]
        image, seconds = in_parts(request["render_seed"], request["first"], samples) if exact else anew(request["seed"], samples)
        return np.array(image, dtype=np.float32), seconds, samples

    probe = _core.Render(scene, [*settings, ("seed", "0")], 1, None)
    probe.advance(0)
    stats = json.loads(probe.stats())
    differences = [] if exact else ["passes are renders of their own, with seeds of their own: images at equal seeds are not those of other builds"]
    return {"version": f"ambilux {ambilux.__version__} ({_core.git_revision})", "device": stats["device"], "backend": stats["backend"], "compile_seconds": 0.0,
            "changes": [], "differences": differences}, render


if __name__ == "__main__":
    serve(start, whole=True)
