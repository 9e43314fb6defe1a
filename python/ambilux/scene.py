"""Scenes from files and from dictionaries."""

from __future__ import annotations

import json
import operator
import os
import warnings
from collections.abc import Mapping
from typing import Any

from ambilux import _core, dictionary
from ambilux.errors import AmbiluxWarning, SceneError, UsageError


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
            self._load(path, "\n".join(lines.text), {}, size, lenient, light_picking, limits)
        except SceneError as e:
            if e.file != path:
                raise
            key = lines.paths[e.line - 1] if e.line else ""
            message = str(e)[len(path):].lstrip(":0123456789").lstrip()
            raise SceneError(f"{key or 'the dictionary'}: {message}", key=key) from None

    def _load(self, path: str, text: str | None, defines: Mapping[str, Any], size: tuple[int, int] | None, lenient: bool, light_picking: str,
              limits: Mapping[str, int | str] | None) -> None:
        if light_picking not in ("power", "uniform"):
            raise UsageError(f"light_picking {light_picking!r}: power and uniform are known, and tree is a setting of renders")
        self._source = (path, text, dict(defines), lenient, light_picking, limits)
        self._core = _core.load(path, text, [(k, setting_text(v)) for k, v in defines.items()], checked_size(size), lenient, light_picking == "uniform",
                                [f"{k}={v}" for k, v in (limits or {}).items()])
        for text in self._core.warnings:
            warnings.warn(text, AmbiluxWarning, stacklevel=4)

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
        """The same scene, loaded again, with an image of another size.

        >>> scene.resized((8, 6)).size
        (8, 6)
        """
        path, text, defines, lenient, light_picking, limits = self._source
        other = Scene.__new__(Scene)
        other._load(path, text, defines, size, lenient, light_picking, limits)
        return other

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


def setting_text(value: Any) -> str:
    """As the command line writes it: True is true, a list is joined by +."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "+".join(map(setting_text, value))
    return str(value)
