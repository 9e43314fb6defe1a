"""Renders: at once, step by step, and references."""

from __future__ import annotations

import json
import numbers
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ambilux import _core
from ambilux.errors import UsageError, warn
from ambilux.image import DeviceArray, Image, StrategyImage
from ambilux.records import Record, record
from ambilux.replays import outliers_of
from ambilux.scene import Scene, checked_size, load, setting_text


def scene_of(scene: Scene | str | os.PathLike[str], size: tuple[int, int] | None) -> Scene:
    if not isinstance(scene, Scene):
        return load(scene, size=size)
    return scene if size is None or checked_size(size) == scene.size else scene.resized(size)


def assignments(settings: Mapping[str, Any] | None, **named: Any) -> list[tuple[str, str]]:
    """Settings in the order in which they are set; `settings` has the last word."""
    given = {k: v for k, v in named.items() if v is not None}
    if not isinstance(settings or {}, Mapping):
        raise UsageError(f"settings {settings!r}: a dictionary is needed, such as {{'rr_depth': 3}}")
    return [(str(k), setting_text(v)) for k, v in [*given.items(), *(settings or {}).items()]]


def count(name: str, value: int) -> int:
    if not isinstance(value, numbers.Real) or isinstance(value, bool) or value != value // 1 or not 0 <= value < 2**64:
        raise UsageError(f"{name} {value}: a whole number that is not negative, below 2**64, is needed")
    return int(value)


def names(what: str, values: Sequence[str]) -> list[str]:
    if isinstance(values, str):
        raise UsageError(f"{what} {values!r}: a list of names is needed, such as [{values!r}]")
    return list(values)


def begin(scene: Scene, settings: Mapping[str, Any] | None, spp: int | None, time: float | None, extras: Mapping[str, Any] = {}, **named: Any) -> _core.Render:
    """`extras`: what the render is to have besides its image."""
    if not isinstance(time, (numbers.Real, type(None))):
        raise UsageError(f"time {time!r}: seconds are needed")
    core = _core.Render(scene._core, assignments(settings, **named), None if spp is None else count("spp", spp), time, **extras)
    warn(core.warnings)
    return core


def backend_of(device: str | None, backend: str | None, settings: Mapping[str, Any] | None) -> str | None:
    """Images stay on the device that renders them."""
    if device not in (None, "cpu", "cuda"):
        raise UsageError(f"device {device!r}: cpu and cuda are known")
    if device != "cuda":
        return backend
    if (chosen := (settings or {}).get("backend", backend)) not in (None, "auto", "cuda"):
        raise UsageError(f"device 'cuda': backend {chosen!r} has its images on the host")
    return "cuda"


def finished(core: _core.Render, device: str | None) -> Image:
    if lost := core.lost():
        warn([lost])
    return image_of(core, device)


def image_of(core: _core.Render, device: str | None) -> Image:
    array = core.device_image() if device == "cuda" else None
    on_device = None if array is None else DeviceArray(array)
    return Image._of(core.pixels(), stats=record(core.stats()), attributes=json.loads(core.attributes()), on_device=on_device)


def render(scene: Scene | str | os.PathLike[str], integrator: str | None = None, variant: str | None = None, *, spp: int | None = None, time: float | None = None,
           seed: int | None = None, size: tuple[int, int] | None = None, max_depth: int | None = None, backend: str | None = None,
           device: str | None = None, settings: Mapping[str, Any] | None = None, aovs: Sequence[str] = (),
           technique_images: bool | str | os.PathLike[str] = False, outliers: int = 0) -> Image:
    """Renders `spp` samples per pixel, or for `time` seconds; with neither as many as the scene asks for, and without `integrator` by the scene's.

    With device="cuda" the image is on the device as well, as `image.on_device`. `settings` are those of `ambilux help settings`. Other threads run meanwhile. An interrupt (KeyboardInterrupt) ends it
    after the sample per pixel in work. Raises UsageError for values that are not allowed, DeviceError where the device or its memory fails.

    `aovs` names layers, which become `image.aovs`: albedo, normal, depth, position, samples, variance, connections (docs/aovs.md). With `technique_images` there are images of
    all strategies in `image.strategies`, and as files in the folder of that name, if it is one. `image.outliers` lists `outliers` pixels, by the largest
    difference between one sample and the mean of their others.

    >>> image = ambilux.render(scene, "bdpt", spp=2, seed=1, settings={"strategies": ["hits", "next_event"]})
    >>> image.samples, image.stats["integrator"], image.variance.shape == image.shape
    (2, 'bdpt', True)
    >>> image = ambilux.render(scene, "bdpt", spp=2, aovs=["depth", "normal"], technique_images=True, outliers=1)
    >>> image.aovs["normal"].shape, image.strategies[0].raw.shape, len(image.outliers)
    ((24, 32, 3), (24, 32, 3), 1)
    """
    backend = backend_of(device, backend, settings)
    most = count("outliers", outliers)
    if most and device == "cuda":
        raise UsageError("outliers: samples are looked at one by one on the host; leave device='cuda' out, and take backend='cuda'")
    loaded = scene_of(scene, size)
    extras = {"aovs": names("aovs", aovs), "technique_images": bool(technique_images), "outliers": most > 0}
    core = begin(loaded, settings, spp, time, extras, integrator=integrator, variant=variant, seed=seed, max_depth=max_depth, backend=backend)
    core.advance(0)
    image = finished(core, device)
    image._layers = core.layers() if aovs else []
    if technique_images:
        image.strategies = [StrategyImage(*values) for values in core.strategies()]
        if not isinstance(technique_images, bool):
            core.write_techniques(os.fspath(technique_images))
    image.outliers = outliers_of(loaded._core, core, most)
    return image


@dataclass(frozen=True)
class Step:
    """Where a render stands."""

    image: Image
    samples: int  #: per pixel
    seconds: float  #: of wall clock inside the renderer

    @property
    def stats(self) -> Record:
        return self.image.stats

    @property
    def variance(self) -> Any:
        return self.image.variance


def progressive(scene: Scene | str | os.PathLike[str], integrator: str | None = None, variant: str | None = None, *, spp: int | None = None,
                time: float | None = None, every: float = 0.5, seed: int | None = None, size: tuple[int, int] | None = None, max_depth: int | None = None,
                backend: str | None = None, device: str | None = None, settings: Mapping[str, Any] | None = None) -> Iterator[Step]:
    """The same render, with the image so far about `every` seconds of rendering and at the end. Raises as `render` does.

    >>> steps = list(ambilux.progressive(scene, spp=64, every=0.01))
    >>> steps[-1].samples, all(a.samples < b.samples for a, b in zip(steps, steps[1:]))
    (64, True)
    """
    if not isinstance(every, numbers.Real) or not every > 0:
        raise UsageError(f"every {every}: more than zero seconds are needed")
    backend = backend_of(device, backend, settings)
    core = begin(scene_of(scene, size), settings, spp, time, integrator=integrator, variant=variant, seed=seed, max_depth=max_depth, backend=backend)
    return steps_of(core, every, device)


def steps_of(core: _core.Render, every: float, device: str | None) -> Iterator[Step]:
    shown, more = 0, True
    while more:
        more = core.advance(every)
        if core.samples > shown:
            shown = core.samples
            image = image_of(core, device) if more else finished(core, device)
            yield Step(image, core.samples, core.seconds)


def reference(scene: Scene | str | os.PathLike[str], path: str | os.PathLike[str], *, spp: int, seed: int | None = None,
              size: tuple[int, int] | None = None, max_depth: int | None = None, backend: str | None = None,
              settings: Mapping[str, Any] | None = None) -> Image:
    """Ground truth with its standard error, in the EXR file at `path`, which is continued if it exists. An interrupt saves what is finished.

    `spp` is of the whole reference, at least 2. The path tracer makes it unless `settings` names another integrator. Raises SceneError if the file is of another scene,
    size, seed or method, UsageError for settings that a reference cannot have.
    """
    if os.fspath(path).lower().endswith(".png"):
        raise UsageError(f"{os.fspath(path)}: a reference is an EXR file, whose name ends in .exr")
    core, attributes = _core.reference(scene_of(scene, size)._core, os.fspath(path), count("spp", spp),
                                       assignments(settings, integrator="path", seed=seed, max_depth=max_depth, backend=backend))
    return Image._of(core, attributes=json.loads(attributes))
