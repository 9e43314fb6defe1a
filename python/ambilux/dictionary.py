"""Scenes as dictionaries of the form that mitsuba.load_dict takes, turned into the XML that the reader of scene files knows.

An element stands in one line, so that the line of an error names its key.
"""

from __future__ import annotations

import numbers
import re
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from ambilux import _core
from ambilux.arrays import numbers_of, plain
from ambilux.errors import SceneError

TAG_OF: dict[str, str] = _core.plugins()  # of each type that the reader of scene files knows
COLOURS = ("rgb", "srgb", "spectrum")
#: Spectra that are objects.
SPECTRA = ("uniform", "d65", "blackbody", "regular", "irregular")
#: Keys of arrays in memory.
MESH_KEYS, IMAGE_KEY = ("vertex_positions", "vertex_normals", "vertex_texcoords", "faces"), "data"


class Lines:
    """XML, and the path of keys of every line."""

    def __init__(self) -> None:
        self.text: list[str] = []
        self.paths: list[str] = []
        #: By the ids of their objects.
        self.meshes: dict[str, dict[str, Any]] = {}
        self.images: dict[str, Any] = {}

    def add(self, text: str, path: str) -> None:
        self.text.append(text)
        self.paths.append(path)


def fail(path: str, message: str) -> NoReturn:
    raise SceneError(f"{path or 'the dictionary'}: {message}", key=path)


def number_list(value: Any) -> list[float] | None:
    """Of a sequence or array of numbers; None of anything else."""
    array = None if isinstance(value, Mapping) else numbers_of(value)
    return array.ravel().tolist() if array is not None and array.ndim else None


def joined(values: list[float]) -> str:
    return " ".join(repr(v) for v in values)


def element(tag: str, end: str = "/", **attributes: str) -> str:
    return f"<{tag}{''.join(f' {k}={attribute(v)}' for k, v in attributes.items())}{end}>"


def attribute(text: str) -> str:
    # A line break would end the element's line; tabs and breaks are references in XML.
    return quoteattr(text, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def transform_steps(value: Any, path: str) -> Iterator[str]:
    """A matrix, one step such as {"translate": [0, 1, 0]}, or a list of these, applied in their order."""
    matrix = number_list(getattr(value, "matrix", value))
    if matrix is not None:
        if len(matrix) not in (9, 16):
            fail(path, f"a transform has 16 or 9 numbers, not {len(matrix)}")
        yield element("matrix", value=joined(matrix))
        return
    if isinstance(value, str) or not hasattr(value, "__iter__"):
        fail(path, f"a transform is a matrix or steps such as {{'translate': [0, 1, 0]}}, not {value!r}")
    for step in [value] if isinstance(value, Mapping) else value:
        if not isinstance(step, Mapping):
            yield from transform_steps(step, path)
            continue
        for name, argument in step.items():
            if name == "look_at":
                if not isinstance(argument, Mapping):
                    fail(f"{path}.look_at", "write it as {'origin': [x, y, z], 'target': [x, y, z], 'up': [x, y, z]}")
                yield element("lookat", **{k: joined(number_list(v) or []) for k, v in argument.items()})
            elif name == "rotate":
                if not isinstance(argument, Mapping) or set(argument) != {"axis", "angle"} or not isinstance(argument["angle"], numbers.Real):
                    fail(f"{path}.rotate", "write it as {'axis': [x, y, z], 'angle': degrees}")
                yield element("rotate", value=joined(number_list(argument["axis"]) or []), angle=repr(float(argument["angle"])))
            elif name in ("translate", "scale"):
                value_of = [float(argument)] if isinstance(argument, numbers.Real) else number_list(argument)
                yield element(name, value=joined(value_of or []))
            else:
                fail(f"{path}.{name}", "translate, scale, rotate and look_at are the steps of a transform")


def add_colour(lines: Lines, name: str, value: Mapping[str, Any], path: str) -> None:
    content = value.get("value")
    extra = set(value) - {"type", "value", "filename"}
    if extra:
        fail(f"{path}.{sorted(extra)[0]}", f"unknown key of {value['type']}: value is known")
    if "filename" in value:
        lines.add(element(value["type"], name=name, filename=str(value["filename"])), path)
    elif isinstance(content, str):
        lines.add(element(value["type"], name=name, value=content), path)
    elif isinstance(content, numbers.Real):
        lines.add(element(value["type"], name=name, value=repr(float(content))), path)
    elif value["type"] == "spectrum" and content is not None and all(hasattr(pair, "__len__") and len(pair) == 2 for pair in content):
        lines.add(element("spectrum", name=name, value=", ".join(f"{float(w)!r}:{float(v)!r}" for w, v in content)), path)
    elif (values := number_list(content)) is not None:
        lines.add(element(value["type"], name=name, value=joined(values)), path)
    else:
        fail(path, f"a {value['type']} has a value: numbers")


def add_spectrum(lines: Lines, name: str, value: Mapping[str, Any], path: str) -> None:
    lines.add(element("spectrum", "", type=value["type"], name=name), path)
    for key, inner in value.items():
        if key != "type":
            values = number_list(inner)
            add_value(lines, str(key), inner if values is None else joined(values), f"{path}.{key}")
    lines.add("</spectrum>", path)


def add_value(lines: Lines, name: str, value: Any, path: str) -> None:
    value = plain(value)
    if isinstance(value, Mapping) and value.get("type") in COLOURS:
        add_colour(lines, name, value, path)
    elif isinstance(value, Mapping) and value.get("type") in SPECTRA:
        add_spectrum(lines, name, value, path)
    elif isinstance(value, Mapping) and value.get("type") == "ref":
        lines.add(element("ref", name=name, id=str(value.get("id", ""))), path)
    elif name.startswith("to_") or hasattr(value, "matrix"):
        steps = "".join(transform_steps(value, path))
        lines.add(element("transform", "", name=name) + steps + "</transform>", path)
    elif isinstance(value, Mapping):
        add_object(lines, name, value, path)
    elif isinstance(value, bool):
        lines.add(element("boolean", name=name, value=str(value).lower()), path)
    elif isinstance(value, numbers.Integral):
        lines.add(element("integer", name=name, value=str(int(value))), path)
    elif isinstance(value, numbers.Real):
        lines.add(element("float", name=name, value=repr(float(value))), path)
    elif (values := number_list(value)) is not None:
        if len(values) != 3:
            fail(path, f"a point or vector has three numbers, not {len(values)}")
        lines.add(element("point", name=name, value=joined(values)), path)
    elif isinstance(value, str) or hasattr(value, "__fspath__"):
        lines.add(element("string", name=name, value=str(value)), path)
    else:
        fail(path, f"a {type(value).__name__} means nothing in a scene")


def alternative(kind: str) -> str:
    """The nearest known type, for somebody who mistyped it."""
    near = _core.nearest_name(list(TAG_OF), kind)
    return f"; is {near} ({TAG_OF[near]}) meant?" if near else ""


def add_object(lines: Lines, name: str, value: Mapping[str, Any], path: str) -> None:
    kind = value.get("type")
    if not isinstance(kind, str):
        fail(path, "an object has a type")
    tag = "shape" if kind == "mesh" else TAG_OF.get(kind)
    if tag is None:
        fail(f"{path}.type", f"unknown type '{kind}'{alternative(kind)}")
    attributes = {"type": "ply" if kind == "mesh" else kind}
    depth = path.count(".")
    arrays = [key for key in (MESH_KEYS if tag == "shape" else (IMAGE_KEY,) if kind in ("bitmap", "envmap") else ()) if key in value]
    if depth == 0 or "id" in value or arrays:
        attributes["id"] = str(value.get("id", name if depth == 0 else path.lstrip(".")))
    if arrays and tag == "shape":
        lines.meshes[attributes["id"]] = {key: value[key] for key in arrays}
    elif arrays:
        lines.images[attributes["id"]] = value[IMAGE_KEY]
    # Names of objects matter where they are parameters, such as textures and BSDFs inside of others.
    if depth and re.fullmatch(r"[a-z_]\w*", name) and tag in ("texture", "bsdf"):
        attributes["name"] = name
    lines.add(element(tag, "", **attributes), path)
    for key, inner in value.items():
        if key not in ("type", "id", *arrays):
            add_value(lines, str(key), inner, f"{path}.{key}")
    lines.add(f"</{tag}>", path)


def to_xml(scene: Mapping[str, Any]) -> Lines:
    """The scene as XML, of format 3 unless the dictionary has a version."""
    if not isinstance(scene, Mapping) or scene.get("type") != "scene":
        fail("type", "a scene is a dictionary with 'type': 'scene'")
    lines = Lines()
    lines.add(element("scene", "", version=str(scene.get("version", "3.0.0"))), "type")
    for key, value in scene.items():
        if key not in ("type", "version"):
            if not isinstance(value, Mapping):
                fail(str(key), "a scene holds objects, which are dictionaries")
            add_object(lines, str(key), value, str(key))
    lines.add("</scene>", "type")
    return lines


def floats(text: str) -> list[float]:
    return [float(word) for word in text.replace(",", " ").split()]


def value_of(node: ElementTree.Element, core: _core.Scene) -> Any:
    """What an element of the scene's XML stands for."""
    text = node.get("value", "")
    if node.tag == "boolean":
        return text == "true"
    if node.tag in ("integer", "float"):
        return int(text) if node.tag == "integer" else float(text)
    if node.tag in ("string", "vector"):
        return text if node.tag == "string" else floats(text)
    if node.tag == "transform":
        matrix = floats(node[0].get("value", ""))
        return [matrix[i:i + 4] for i in range(0, 16, 4)]
    if node.tag == "ref":
        return {"type": "ref", "id": node.get("id")}
    if node.tag in COLOURS:
        pairs = [[float(x) for x in pair.split(":")] for pair in text.split(",")] if ":" in text else None
        numbers = floats(text) if pairs is None else pairs
        return {"type": node.tag, "value": numbers[0] if len(numbers) == 1 else numbers}
    return object_of(node, core)


def unused(base: str, taken: Mapping[str, Any]) -> str:
    """`base`, or with a number from 2 on where it is taken."""
    number, key = 2, base
    while key in taken:
        key, number = f"{base}_{number}", number + 1
    return key


def object_of(node: ElementTree.Element, core: _core.Scene) -> dict[str, Any]:
    out: dict[str, Any] = {"type": node.get("type", "")}
    if node.get("id"):
        out["id"] = node.get("id")
    for inner in node:
        out[unused(inner.get("name") or inner.tag, out)] = value_of(inner, core)
    if node.tag == "shape" and str(out.get("mesh", "")).startswith("array "):
        arrays = core.mesh(out.pop("mesh"))
        origin = arrays.pop("origin")
        out.update({name: array for name, array in arrays.items() if len(array)})
        if any(origin):
            out["vertex_positions"] = arrays["vertex_positions"] + origin
    if str(out.get("image", "")).startswith("array "):
        out[IMAGE_KEY] = core.image(out.pop("image"))[0]
    return out


def from_xml(text: str, core: _core.Scene) -> dict[str, Any]:
    """The dictionary of a scene that the core wrote as XML."""
    root = ElementTree.fromstring(text)
    scene: dict[str, Any] = {"type": "scene"}
    if root.get("version") != "3.0.0":
        scene["version"] = root.get("version")
    for node in root:
        key = unused(node.get("id") or node.tag, scene)
        scene[key] = value_of(node, core)
        scene[key].pop("id", None)
    return scene
