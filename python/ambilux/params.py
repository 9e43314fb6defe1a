"""Parameters of a scene by name, and changes of them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn

import numpy as np

from ambilux import _core, dictionary
from ambilux.arrays import numbers_of, plain
from ambilux.errors import SceneError

#: Shapes of arrays by the kinds of parameters.
SHAPES = {"boolean": ((),), "integer": ((),), "number": ((), (3,)), "vector": ((3,),), "rgb": ((), (3,)), "spectrum": ((), (3,), (None, 2)),
          "transform": ((4, 4), (16,), (3, 3), (9,))}
WANTED = {"boolean": "True or False", "integer": "an integer", "number": "a number", "vector": "three numbers", "rgb": "a number or three of them",
          "spectrum": "a number, three of them, or pairs of wavelength and value", "transform": "a matrix of 4x4, or steps such as {'translate': [0, 1, 0]}",
          "text": "a text"}
UNITS = {"radiance": "W/(m² sr)", "intensity": "W/sr", "irradiance": "W/m²", "power": "W", "fov": "degrees, between 0 and 180", "cutoff_angle": "degrees",
         "beam_width": "degrees", "reflectance": "a share, 0 to 1", "alpha": "roughness, 0 and more", "near_clip": "units of the scene", "far_clip": "units of the scene",
         "aperture_radius": "units of the scene", "focus_distance": "units of the scene", "position": "units of the scene", "opacity": "a share, 0 to 1"}
MESH_ARRAYS = {"vertex_positions": (np.float64, 3), "vertex_normals": (np.float32, 3), "vertex_texcoords": (np.float32, 2), "faces": (np.uint32, 3)}


def unit_of(name: str) -> str:
    last = name.rsplit(".", 1)[-1]
    return UNITS.get(last, UNITS["reflectance"] if last.endswith(("reflectance", "transmittance")) else "")


def fail(name: str, message: str) -> NoReturn:
    raise SceneError(f"{name}: {message}", key=name)


class Params(Mapping[str, Any]):
    """What of a scene can be changed, as Mitsuba's `traverse` shows it: numbers as float, int and bool, colours, points and matrices as arrays of float64, meshes
    (NAME.vertex_positions, .vertex_normals, .vertex_texcoords, .faces) and images (NAME.data) as arrays that are read when they are asked for.

    An object is called by its id, others by that of the object around them and what they are there: floor.bsdf.reflectance. What the file does not say is here
    with the value that holds. `Scene.with_params` makes scenes of other values.
    """

    def __init__(self, core: _core.Scene):
        self._core = core
        self._entries: dict[str, dict[str, Any]] = {}
        for entry in json.loads(core.parameters()):
            if entry["kind"] == "mesh":
                for array in MESH_ARRAYS:
                    self._entries[f"{entry['name']}.{array}"] = {**entry, "object": entry["name"], "array": array}
            elif entry["kind"] == "image":
                self._entries[f"{entry['name']}.data"] = {**entry, "object": entry["name"]}
            else:
                self._entries[entry["name"]] = entry

    def __getitem__(self, name: str) -> Any:
        entry = self._entries.get(name)
        if entry is None:
            near = _core.nearest_name(list(self._entries), name) or self._nearest_last(name)
            raise KeyError(f"{name}: the scene has no such parameter{f'; is {near} meant?' if near else ''}")
        if entry["kind"] == "mesh":
            arrays = self._core.mesh(entry["object"])
            array = arrays[entry["array"]]
            return array + np.array(arrays["origin"]) if entry["array"] == "vertex_positions" and any(arrays["origin"]) else array
        if entry["kind"] == "image":
            return linear(*self._core.image(entry["object"]))
        value = entry["value"]
        return np.array(value, dtype=np.float64) if isinstance(value, list) else value

    def _nearest_last(self, name: str) -> str:
        """The parameter of the same object that its last part means."""
        prefix, _, last = name.rpartition(".")
        there = {n.rpartition(".")[2]: n for n in self._entries if n.rpartition(".")[0] == prefix}
        return there.get(_core.nearest_name(list(there), last), "")

    def first(self, tag: str) -> str | None:
        """The name of the first object of this kind."""
        return next((e["object"] for e in self._entries.values() if e["tag"] == tag), None)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __repr__(self) -> str:
        width = max(map(len, self._entries), default=0)
        return "\n".join(f"{name:{width}}  {self._shown(name)}" for name in self._entries)

    def _shown(self, name: str) -> str:
        entry = self._entries[name]
        if entry["kind"] in ("mesh", "image"):
            return "array"
        value = entry["value"]
        shown = "4x4 matrix" if entry["kind"] == "transform" else f"{len(value)} pairs" if value and isinstance(value, list) and isinstance(value[0], list) else str(value)
        return "  ".join(filter(None, [shown, unit_of(name), "" if entry["given"] else "(default)"]))

    def edits(self, changes: Mapping[str, Any]) -> list[_core.Edit]:
        """Changes as the core takes them."""
        if not isinstance(changes, Mapping):
            raise SceneError(f"{changes!r}: a dictionary is needed, such as {{'lamp.radiance': 2}}", key="with_params")
        edits: list[_core.Edit] = []
        meshes: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            name = str(name)
            if name not in self._entries and name.endswith(".value") and name[:-6] in self._entries:
                name = name[:-6]  # as Mitsuba has it
            entry = self._entries.get(name, {})
            if entry.get("kind") == "mesh":
                meshes.setdefault(entry["object"], {})[entry["array"]] = value
            elif entry.get("kind") == "image":
                edits.append(image_edit(entry["object"], name, value))
            else:
                lines = dictionary.Lines()
                edits.append(_core.Edit(name, text_of(name, value, entry.get("kind"), lines)))
                edits += array_edits(lines)
        return edits + [mesh_edit(name, arrays, self._core) for name, arrays in meshes.items()]


def array_edits(lines: dictionary.Lines) -> list[_core.Edit]:
    """Arrays of the objects that these lines describe."""
    return [*(mesh_edit(name, arrays) for name, arrays in lines.meshes.items()),
            *(image_edit(name, f"{name}.data", value) for name, value in lines.images.items())]


def refuse(name: str, kind: str, given: str) -> NoReturn:
    unit = unit_of(name)
    fail(name, f"{WANTED[kind]} is needed{f' ({unit})' if unit else ''}, not {given}")


def element_of(name: str, value: Any, kind: str | None, lines: dictionary.Lines) -> str:
    """A truth value, a text or a dictionary as an element of a scene file."""
    named = name.endswith(("ior", "eta"))  # a number, or the name of a material
    if isinstance(value, (bool, str)) and kind not in (None, "boolean" if isinstance(value, bool) else "text") and not (named and isinstance(value, str)):
        refuse(name, kind, repr(value))
    last = name.rsplit(".", 1)[-1]
    if kind == "transform" or last.startswith("to_"):
        return dictionary.element("transform", "", name=last) + "".join(dictionary.transform_steps(value, name)) + "</transform>"
    try:
        dictionary.add_value(lines, last, value, f".{name}")  # as an object inside of another, which gets no id of its own
    except SceneError as e:
        raise SceneError(str(e).lstrip("."), key=e.key.lstrip(".")) from None
    return "".join(lines.text)


def text_of(name: str, value: Any, kind: str | None, lines: dictionary.Lines) -> str:
    """A value as a scene file holds it, or as an element of one; the text of None is empty."""
    value = plain(value)
    if value is None:
        return ""
    array = None if isinstance(value, Mapping) else numbers_of(value)
    if array is None:
        return element_of(name, value, kind, lines)
    shapes = SHAPES.get(kind or "", None)
    if kind == "text" and array.ndim == 0:
        return f"{value!r}"  # such as the index of a glass that was named
    if kind == "text" or (shapes and not any(len(s) == array.ndim and all(a in (None, b) for a, b in zip(s, array.shape)) for s in shapes)):
        refuse(name, kind or "text", f"an array of shape {array.shape}")
    if array.ndim == 2 and array.shape[1] == 2:
        return ", ".join(f"{w!r}:{v!r}" for w, v in array.tolist())
    numbers = value if isinstance(value, int) else array.ravel().tolist()
    return repr(numbers) if isinstance(numbers, int) else " ".join(map(repr, numbers))


def array_of(name: str, value: Any, dtype: Any, columns: int) -> np.ndarray:
    try:
        source = np.asarray(plain(value))
    except ValueError:
        fail(name, "rows of one length are needed")
    if source.dtype.kind not in "fiu":
        fail(name, f"numbers are needed, not {source.dtype}")
    with np.errstate(all="ignore"):
        array = np.ascontiguousarray(source, dtype=dtype)
    if array.dtype.kind == "u" and not np.array_equal(array, source):
        fail(name, "whole numbers from 0 to 2**32 - 1 are needed, indices of vertices")
    if array.ndim == 1 and array.size % columns == 0:
        array = array.reshape(-1, columns)  # as Mitsuba has them
    if array.ndim != 2 or array.shape[1] != columns:
        fail(name, f"an array of shape (n, {columns}) is needed, not {array.shape}")
    return array


def mesh_edit(name: str, arrays: Mapping[str, Any], core: _core.Scene | None = None) -> _core.Edit:
    """A mesh with these arrays; those that are not there are the ones of the scene."""
    given = {key: array_of(f"{name}.{key}", value, *MESH_ARRAYS[key]) for key, value in arrays.items() if value is not None}
    if core is not None:
        there = core.mesh(name)
        for key in set(MESH_ARRAYS) - set(arrays):
            array = there[key] + np.array(there["origin"]) if key == "vertex_positions" else there[key]
            given[key] = np.ascontiguousarray(array, dtype=MESH_ARRAYS[key][0])
    for key in ("vertex_positions", "faces"):
        if key not in given:
            fail(name, f"a mesh needs {key}")
    count = len(given["vertex_positions"])
    for key in ("vertex_normals", "vertex_texcoords"):
        array = given.get(key)
        if array is not None and len(array) not in (0, count):
            fail(f"{name}.{key}", f"one row for each of {count} vertices is needed, not {len(array)}; None leaves them out")
    return _core.Edit.mesh(name, given["vertex_positions"], given["faces"],
                           *(a if (a := given.get(key)) is not None and len(a) else None for key in ("vertex_normals", "vertex_texcoords")))


def image_edit(name: str, key: str, value: Any) -> _core.Edit:
    """An image of (height, width), or with 1, 3 or 4 channels: floats are linear, bytes as a PNG file has them."""
    array = np.asarray(plain(value))
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3 or array.shape[2] not in (1, 3, 4) or array.size == 0 or array.dtype.kind not in "fiu":
        fail(key, f"an array of (height, width), or with 1, 3 or 4 channels, is needed, not {array.shape} of {array.dtype}")
    if array.dtype.kind in "iu" and array.dtype != np.uint8 and (array.min() < 0 or array.max() > 1):
        fail(key, f"floats, which are linear, or bytes (uint8), as a PNG file has them, are needed, not {array.dtype}")
    array = array if array.dtype == np.uint8 else array.astype(np.float32)
    if not np.isfinite(array).all():
        fail(key, "a value is not finite")
    if array.shape[2] == 1:
        array = np.repeat(array, 3, axis=2)
    if array.shape[2] == 3:
        array = np.concatenate([array, np.full((*array.shape[:2], 1), 255 if array.dtype == np.uint8 else 1, array.dtype)], axis=2)
    array = np.ascontiguousarray(array)
    return _core.Edit.bytes(name, array) if array.dtype == np.uint8 else _core.Edit.floats(name, array)


def linear(stored: np.ndarray, is_linear: bool) -> np.ndarray:
    """RGB, or RGBA where alpha says something: bytes as they are stored, floats linear."""
    opaque = 255 if stored.dtype == np.uint8 else 1
    return np.ascontiguousarray(stored[:, :, :3]) if (stored[:, :, 3] == opaque).all() else stored
