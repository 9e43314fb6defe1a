"""Scenes from files and from dictionaries, and what changes make of them."""

from __future__ import annotations

import json
import operator
import os
import warnings
from collections.abc import Mapping
from typing import Any

from ambilux import _core, dictionary
from ambilux.arrays import numbers_of, plain
from ambilux.errors import AmbiluxWarning, SceneError, UsageError
from ambilux.params import Params, array_edits, unit_of


def checked_size(size: tuple[int, int] | None) -> tuple[int, int]:
    if size is None:
        return 0, 0
    try:
        width, height = (operator.index(n) for n in size)
    except (TypeError, ValueError):
        raise UsageError(f"size {size!r}: two integers are needed, (width, height)") from None
    if not (1 <= width <= 65536 and 1 <= height <= 65536):
        raise UsageError(f"size {width}x{height}: from 1 to 65536 pixels a side")
    return width, height


class Scene:
    """A loaded scene. `Scene({...})` takes a dictionary as mitsuba.load_dict does; `load` reads a file.

    Files that the dictionary names are looked for in `folder`. Transforms are matrices, or steps in the order in which they apply.

    >>> scene = ambilux.Scene({
    ...     "type": "scene",
    ...     "sensor": {"type": "perspective", "fov": 40.0,
    ...                "to_world": {"look_at": {"origin": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0]}},
    ...                "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}}},
    ...     "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.4, 0.3]}}},
    ...     "sky": {"type": "constant"},
    ... })
    >>> scene.size
    (16, 16)
    """

    def __init__(self, description: Mapping[str, Any], *, folder: str | os.PathLike[str] = "", size: tuple[int, int] | None = None, lenient: bool = False,
                 light_picking: str = "power", limits: Mapping[str, int | str] | None = None):
        lines = dictionary.to_xml(description)
        path = os.path.join(folder, "<dictionary>")
        try:
            self._load(path, "\n".join(lines.text), {}, size, lenient, light_picking, limits, array_edits(lines))
        except SceneError as e:
            if e.file != path:
                raise
            key = lines.paths[e.line - 1] if e.line else ""
            message = str(e)[len(path):].lstrip(":0123456789").lstrip()
            raise SceneError(f"{key or 'the dictionary'}: {message}", key=key) from None

    def _load(self, path: str, text: str | None, defines: Mapping[str, Any], size: tuple[int, int] | None, lenient: bool, light_picking: str,
              limits: Mapping[str, int | str] | None, edits: list[_core.Edit] | None = None) -> None:
        if light_picking not in ("power", "uniform"):
            raise UsageError(f"light_picking {light_picking!r}: power and uniform are known, and tree is a setting of renders")
        core = _core.load(path, text, [(k, setting_text(v)) for k, v in defines.items()], checked_size(size), lenient, light_picking == "uniform",
                          [f"{k}={v}" for k, v in (limits or {}).items()], edits or [])
        self._take(core)

    def _take(self, core: _core.Scene) -> None:
        self._core = core
        self._params: Params | None = None
        for text in core.warnings:
            warnings.warn(text, AmbiluxWarning, stacklevel=5)

    def _edited(self, edits: list[_core.Edit], size: tuple[int, int] | None = None) -> Scene:
        other = Scene.__new__(Scene)
        other._take(self._core.edited(edits, checked_size(size)))
        return other

    @property
    def path(self) -> str:
        return self._core.path

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image in pixels."""
        return self._core.size

    @property
    def hash(self) -> str:
        """SHA-256 of all that the scene was made from."""
        return self._core.hash

    @property
    def info(self) -> dict[str, Any]:
        """What is in the scene, as `ambilux info --json`."""
        return json.loads(self._core.info())

    def resized(self, size: tuple[int, int]) -> Scene:
        """The same scene with an image of another size.

        >>> scene.resized((8, 6)).size
        (8, 6)
        """
        return self._edited([], size)

    @property
    def params(self) -> Params:
        """What of the scene can be changed, by name; a mapping.

        >>> scene = ambilux.load(SCENES / "cornell.xml", size=(16, 16))
        >>> scene.params["red.reflectance"].shape, scene.params["sensor.fov"]
        ((3,), 39.0)
        """
        if self._params is None:
            self._params = Params(self._core)
        return self._params

    def with_params(self, changes: Mapping[str, Any]) -> Scene:
        """The scene with other values of parameters. What they leave as it is is shared with this one: meshes, the structure over them, textures.

        Values are numbers, arrays (NumPy's, or any that hand themselves over by DLPack), or dictionaries as `Scene({...})` takes them, which may be objects: a
        texture for a reflectance, or by a name that is not there yet another lamp. None takes a value or an object away: what holds where the file says nothing.
        Raises SceneError, whose key is the name.

        >>> scene = ambilux.load(SCENES / "cornell.xml", size=(16, 16))
        >>> other = scene.with_params({"red.reflectance": [0.1, 0.1, 0.6], "sensor.fov": 30})
        >>> other.params["sensor.fov"]
        30.0
        """
        try:
            return self._edited(self.params.edits(changes))
        except SceneError as e:
            raise self._named(e, changes) from None

    def _named(self, error: SceneError, changes: Mapping[str, Any]) -> SceneError:
        """The error with its unit and the parameter that may be meant."""
        if error.key or error.file not in changes:
            return error
        unit = unit_of(error.file)
        return SceneError(f"{error}{f' ({unit})' if unit else ''}", key=error.file)

    def with_camera(self, origin: Any = None, target: Any = None, up: Any = None, fov: float | None = None) -> Scene:
        """The scene seen from `origin` towards `target`, three numbers each in units of the scene, with `fov` in degrees. What is None stays.

        >>> scene = ambilux.load(SCENES / "cornell.xml", size=(16, 16))
        >>> near = scene.with_camera(origin=[0, 0, 2], target=[0, 0, 0], fov=60)
        >>> near.params["sensor.to_world"][:3, 3].tolist()
        [0.0, 0.0, 2.0]
        """
        name = self.params.first("sensor")
        if name is None:
            return self._edited([_core.Edit("sensor", '<sensor type="perspective"/>')]).with_camera(origin, target, up, fov)
        changes: dict[str, Any] = {}
        if any(v is not None for v in (origin, target, up)):
            there = self.params[f"{name}.to_world"]
            place = there[:3, 3] if origin is None else point("origin", origin)
            changes[f"{name}.to_world"] = {"look_at": {"origin": place, "target": place + there[:3, 2] if target is None else point("target", target),
                                                       "up": there[:3, 1] if up is None else point("up", up)}}
        if fov is not None:
            changes[f"{name}.fov"] = fov
            if f"{name}.focal_length" in self.params:
                changes[f"{name}.focal_length"] = None
        return self.with_params(changes)

    def to_dict(self) -> dict[str, Any]:
        """The scene as `Scene({...})` takes it; files by their whole names, arrays as they are.

        >>> scene = ambilux.load(SCENES / "cornell.xml", size=(16, 16))
        >>> scene.to_dict()["red"]["type"]
        'diffuse'
        """
        return dictionary.from_xml(self._core.text(""), self._core)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the scene as Mitsuba's XML; arrays become files in a folder beside it. What another format described is written by `ambilux convert`."""
        name = os.fspath(path)
        if not name.lower().endswith(".xml"):
            raise UsageError(f"{name}: scenes are written as .xml")
        os.makedirs(os.path.dirname(name) or ".", exist_ok=True)
        self._core.write(name)

    def __repr__(self) -> str:
        return f"<ambilux.Scene {self.path} {self.size[0]}x{self.size[1]}>"


def load(path: str | os.PathLike[str], *, size: tuple[int, int] | None = None, lenient: bool = False, light_picking: str = "power",
         limits: Mapping[str, int | str] | None = None, **defines: Any) -> Scene:
    """Reads a scene: Mitsuba XML, pbrt-v4 (.pbrt, .pbrt.gz) or glTF 2.0 (.gltf, .glb). `defines` are values of $parameters of Mitsuba scenes; the others are options
    of `ambilux render`.

    >>> ambilux.load(SCENES / "cornell.xml", resx=40, resy=30).size
    (40, 30)
    >>> ambilux.load("missing.xml")
    Traceback (most recent call last):
    ambilux.errors.SceneError: missing.xml: No such file or directory
    """
    scene = Scene.__new__(Scene)
    scene._load(os.fspath(path), None, defines, size, lenient, light_picking, limits)
    return scene


def point(name: str, value: Any) -> Any:
    array = numbers_of(value)
    if array is None or array.shape != (3,):
        raise UsageError(f"{name} {value!r}: three numbers are needed")
    return array


def setting_text(value: Any) -> str:
    """As the command line writes it: True is true, a list is joined by +."""
    value = plain(value)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "+".join(map(setting_text, value))
    return str(value)
