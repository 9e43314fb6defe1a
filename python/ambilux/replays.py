"""Samples of a render again, with all that happened on their way (docs/replay.md)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ambilux import _core
from ambilux.errors import UsageError
from ambilux.records import Record, record


class Trace(Record):
    """One sample of a pixel, or one light subpath: what `ambilux trace --json` writes, as attributes. `print(trace)` says it in words.

    `eye_subpath.vertices` and `light_subpaths` have the vertices with their densities, `candidates` what the eye subpath found, `splats` what light subpaths
    brought to the pixel, `total` their sum.
    """

    __slots__ = ("_said",)
    _said: str

    def __str__(self) -> str:
        return self._said


class Outlier(Record):
    """The largest sample of a pixel: `pixel` (x, y), `sample`, `value`, by how much it exceeds the mean of the others (`excess`), and the `largest` contribution."""

    __slots__ = ("_render",)
    _render: tuple[_core.Scene, _core.Settings]

    def trace(self, *, light_subpath: int | None = None, strategy: str = "", compare: bool = False) -> Trace:
        """The sample again; arguments as those of `ambilux.trace`."""
        scene, settings = self._render
        return traced(scene, settings, self.pixel, self.sample, light_subpath, strategy, compare)


def outliers_of(scene: _core.Scene, render: _core.Render, most: int) -> list[Outlier]:
    if most == 0:
        return []
    outliers = [Outlier(**vars(found)) for found in record(render.outliers(most)).outliers]
    for outlier in outliers:
        outlier._render = scene, render.used()
    return outliers


def traced(scene: _core.Scene, settings: _core.Settings, pixel: Any, sample: Any, light_subpath: int | None, strategy: str, compare: bool) -> Trace:
    if pixel is None and light_subpath is None:
        raise UsageError("trace: a pixel (x, y) or a light_subpath is needed, or both")
    if compare and (pixel is None or light_subpath is not None):
        raise UsageError("compare: a pixel (x, y) is needed, without light_subpath")
    width, height = scene.size
    if pixel is not None:
        place = tuple(index("pixel", value) for value in pixel) if isinstance(pixel, Iterable) else ()
        if len(place) != 2 or place[0] >= width or place[1] >= height:
            raise UsageError(f"pixel {pixel!r}: the image has {width}x{height} pixels, (x, y) counted from (0, 0) at the top left")
        pixel = place
    light = None if light_subpath is None else index("light_subpath", light_subpath)
    said = _core.trace(scene, settings, pixel, index("sample", sample), light, strategy, compare)
    trace = Trace(**vars(record(said[0])))
    trace._said = said[1]
    return trace


def index(name: str, value: Any) -> int:
    try:
        number = int(value.__index__())
    except (AttributeError, TypeError):
        number = -1
    if not 0 <= number < 2**32:
        raise UsageError(f"{name} {value!r}: a whole number that is not negative, below 2**32, is needed")
    return number
