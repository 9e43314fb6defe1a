"""Scenes of formats 0.5, 0.6, 2 and 3 as one of format 3 that Mitsuba 3 reads, with a list of what was changed.

Names in old formats are those of Mitsuba 0.6 (documentation of that version, chapters 8 and 9); a newer one has snake_case for camelCase.
"""

import re
import xml.etree.ElementTree as xml
from pathlib import Path

from peer_protocol import Refused

# What Mitsuba 3 has not (docs/scenes.md, "Conversion"); its path tracer cannot be compared where a scene needs it.
LACKING = {"bsdf": ("ward", "phong", "difftrans", "coating", "roughcoating"), "sensor": ("spherical",)}
CONDUCTORS = ("conductor", "roughconductor")
AIR = ("air", "vacuum", "1", "1.0")
# Of a film, without meaning for a linear image.
FILM = ("gamma", "banner", "fileFormat", "pixelFormat", "componentFormat", "attachLog", "compensate", "file_format", "pixel_format",
        "component_format", "highQualityEdges", "label[0,0]")


class Changes:
    """What was changed and how often, in the order of first appearance."""

    def __init__(self):
        self.counts = {}

    def add(self, what):
        self.counts[what] = self.counts.get(what, 0) + 1

    def texts(self):
        return [what if n == 1 else f"{what} ({n} times)" for what, n in self.counts.items()]


def snake_case(name):
    """intIOR -> int_ior, toWorld -> to_world."""
    return re.sub(r"([a-z0-9])([A-Z]+)", lambda m: f"{m[1]}_{m[2].lower()}", name)


def number(text):
    try:
        return float(text)
    except ValueError:
        return None


def children(element, name):
    return [e for e in element if e.get("name") == name]


def substitute(root, parameters):
    """$names by values: those asked for over those of <default>."""
    values = {}
    for parent in list(root.iter()):
        for e in list(parent):
            if e.tag == "default":
                values.setdefault(e.get("name"), e.get("value"))
                parent.remove(e)
    values.update(parameters)
    for e in root.iter():
        for key, text in list(e.attrib.items()):
            if "$" in text:
                e.set(key, re.sub(r"\$(\w+)", lambda m: values.get(m[1], m[0]), text))


def rename(root, changes):
    for e in root.iter():
        name = e.get("name")
        if name and name != (new := snake_case(name)):
            e.set("name", new)
            changes.add(f"{name} is {new}")
        if e.tag == "lookAt":
            e.tag = "lookat"
    for e in root.iter("texture"):
        if e.get("type") in ("bitmap", "checkerboard"):
            uv_transform(e, changes)


def uv_transform(texture, changes):
    """uscale, vscale, uoffset, voffset as a transform."""
    values = {}
    for key in ("uscale", "vscale", "uoffset", "voffset"):
        for e in children(texture, key):
            values[key] = e.get("value")
            texture.remove(e)
    if not values:
        return
    changes.add("uscale, vscale, uoffset, voffset are to_uv")
    transform = xml.SubElement(texture, "transform", {"name": "to_uv"})
    xml.SubElement(transform, "scale", {"x": values.get("uscale", "1"), "y": values.get("vscale", "1")})
    xml.SubElement(transform, "translate", {"x": values.get("uoffset", "0"), "y": values.get("voffset", "0")})


def bitmaps(root, old, changes):
    for e in root.iter("texture"):
        if e.get("type") != "bitmap":
            continue
        for gamma in children(e, "gamma"):
            e.remove(gamma)
            value = number(gamma.get("value"))
            if value == 1:
                xml.SubElement(e, "boolean", {"name": "raw", "value": "true"})
                changes.add("gamma 1 of a bitmap is raw")
            elif value not in (-1, 0):
                changes.add(f"gamma {gamma.get('value')} of a bitmap is sRGB: another image")
        for filtering in children(e, "filter_type"):
            if filtering.get("value") in ("ewa", "trilinear"):
                filtering.set("value", "bilinear")
                changes.add("filtered textures are bilinear")
        if old:
            for key in ("max_anisotropy", "cache"):
                for unused in children(e, key):
                    e.remove(unused)


def colours(root, old, changes):
    """<srgb> as <rgb>, which is linear; in old formats a spectrum of one number, or of three, is a colour."""
    for e in root.iter("srgb"):
        text = e.get("value").strip()
        values = [int(text[i:i + 2], 16) / 255 for i in (1, 3, 5)] if text.startswith("#") else numbers_of(text)
        e.tag = "rgb"
        e.set("value", ", ".join(f"{v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4:.9g}" for v in values))
        changes.add("srgb is linear rgb")
    for e in root.iter("spectrum") if old else ():
        text = e.get("value") or ""
        if e.get("type") is None and text and ":" not in text:
            e.tag = "rgb"
            e.set("value", ", ".join(f"{v:.9g}" for v in numbers_of(text)))
            changes.add("a spectrum of one or three numbers is rgb")


def numbers_of(text):
    """Three, of one or three."""
    values = [number(w) for w in re.split(r"[\s,]+", text.strip())]
    if None in values or len(values) not in (1, 3):
        raise Refused(f"'{text}' is no colour of one or three numbers")
    return values * 3 if len(values) == 1 else values


def refuse(root):
    """By name, what no conversion makes the same."""
    for tag, types in LACKING.items():
        for e in root.iter(tag):
            if e.get("type") in types:
                raise Refused(f"{tag} {e.get('type')}: Mitsuba 3 has none")
    for e in root.iter("bsdf"):
        if any(d.get("value") == "phong" for d in children(e, "distribution")):
            raise Refused(f"distribution phong of {e.get('type')}: Mitsuba 3 has none")


def conductors(root, changes):
    """ext_eta divides eta and k; Mitsuba 3 has none."""
    for e in root.iter("bsdf"):
        if e.get("type") not in CONDUCTORS:
            continue
        for outside in children(e, "ext_eta"):
            e.remove(outside)
            text = outside.get("value")
            if text.lower() in AIR:
                changes.add("ext_eta of air is left out")
                continue
            divide(e, number(text))
            changes.add("eta and k are divided by ext_eta")


def divide(bsdf, outside):
    if outside is None or children(bsdf, "material"):
        raise ValueError(f"{bsdf.get('type')}: ext_eta needs numbers for eta and k")
    for key in ("eta", "k"):
        for e in children(bsdf, key):
            words = [number(w) for w in re.split(r"[\s,]+", e.get("value").strip())]
            if None in words:
                raise ValueError(f"{bsdf.get('type')}: {key} is a spectrum, which ext_eta cannot divide here")
            e.set("value", ", ".join(repr(w / outside) for w in words))


def rough_diffuse(root, changes):
    for e in root.iter("bsdf"):
        if e.get("type") == "roughdiffuse":
            e.set("type", "diffuse")
            for key in ("alpha", "use_fast_approx"):
                for unused in children(e, key):
                    e.remove(unused)
            changes.add("roughdiffuse is diffuse, since Mitsuba 3 has no other: another image unless alpha is 0")


def bump_flags(root, changes):
    """Newer than the old formats: they turn normals that face away, and darken."""
    for e in root.iter("bsdf"):
        if e.get("type") not in ("bumpmap", "normalmap"):
            continue
        for flag in ("flip_invalid_normals", "use_shadowing_function"):
            if not children(e, flag):
                xml.SubElement(e, "boolean", {"name": flag, "value": "false"})
                changes.add(f"{flag} of {e.get('type')} is off")


def unused_flags(root, changes):
    """Flags of old formats that say nothing in format 3."""
    for e in root.iter("bsdf"):
        for flag in children(e, "nonlinear") if e.get("type") not in ("plastic", "roughplastic") else ():
            e.remove(flag)
            changes.add(f"nonlinear of {e.get('type')} is left out")
    for e in root.iter("shape"):
        for flag in children(e, "collapse") + children(e, "max_smooth_angle"):
            e.remove(flag)
            changes.add(f"{flag.get('name')} of a shape is left out")


def film_of(root, job, changes):
    sensor = root.find("sensor")
    if sensor is None:
        raise ValueError("the scene has no sensor")
    film = sensor.find("film")
    if film is None:
        film = xml.SubElement(sensor, "film", {"type": "hdrfilm"})
    if film.get("type") != "hdrfilm":
        changes.add(f"film {film.get('type')} is hdrfilm")
        film.set("type", "hdrfilm")
    own = {"width", "height", "crop_offset_x", "crop_offset_y", "crop_width", "crop_height", *map(snake_case, FILM), *FILM}
    for e in list(film):
        if e.tag == "rfilter" and e.get("type") != "box":
            changes.add(f"filter {e.get('type')} is box")
        if e.tag == "rfilter" or e.get("name") in own:
            film.remove(e)
    xml.SubElement(film, "rfilter", {"type": "box"})
    numbers = dict(zip(("width", "height"), job["film"]))
    numbers.update(zip(("crop_offset_x", "crop_offset_y", "crop_width", "crop_height"), job["crop"]))
    for key, value in numbers.items():
        xml.SubElement(film, "integer", {"name": key, "value": str(value)})
    xml.SubElement(film, "string", {"name": "component_format", "value": "float32"})
    for e in sensor.findall("sampler"):
        sensor.remove(e)
    xml.SubElement(sensor, "sampler", {"type": "independent"})


def integrator_of(root, job, changes):
    for e in root.findall("integrator"):
        if e.get("type") != job["integrator"]:
            changes.add(f"integrator {e.get('type')} is {job['integrator']}")
        root.remove(e)
    integrator = xml.Element("integrator", {"type": job["integrator"]})
    depth = job["rr_depth"] if job["rr_depth"] >= 0 else 1 << 30
    for key, value in (("max_depth", job["max_depth"]), ("rr_depth", max(1, depth))):
        xml.SubElement(integrator, "integer", {"name": key, "value": str(value)})
    root.insert(0, integrator)


def absolute_files(root, folder):
    for e in root.iter("string"):
        if e.get("name") == "filename":
            e.set("value", str((folder / e.get("value")).resolve()))


def include(element, folder):
    for i, e in enumerate(list(element)):
        if e.tag == "include":
            part = xml.parse(folder / e.get("filename")).getroot()
            element.remove(e)
            for k, child in enumerate(part if part.tag == "scene" else [part]):
                element.insert(i + k, child)
        else:
            include(e, folder)


def convert(job):
    """(the tree, changes) of the scene of a job."""
    path = Path(job["scene"])
    changes = Changes()
    root = xml.parse(path).getroot()
    include(root, path.parent)
    version = root.get("version", "3.0.0")
    old = int(version.split(".")[0]) < 2
    if old:
        changes.add(f"format {version} is 3.0.0")
    root.set("version", "3.0.0")
    substitute(root, job["parameters"])
    if old:
        rename(root, changes)
    refuse(root)
    colours(root, old, changes)
    bitmaps(root, old, changes)
    conductors(root, changes)
    rough_diffuse(root, changes)
    if old:
        bump_flags(root, changes)
    unused_flags(root, changes)
    film_of(root, job, changes)
    integrator_of(root, job, changes)
    absolute_files(root, path.parent)
    return xml.ElementTree(root), changes.texts()
