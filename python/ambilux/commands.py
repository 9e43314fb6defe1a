"""What the program has besides renders: a sample again, what is in a scene, devices, scenes for other renderers, the stress sweep."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ambilux import _core
from ambilux.errors import AmbiluxNote, UsageError, warn
from ambilux.records import Record, record
from ambilux.rendering import assignments, count, names, scene_of
from ambilux.replays import Trace, index, traced
from ambilux.scene import Scene


def trace(scene: Scene | str | os.PathLike[str], pixel: Sequence[int] | None = None, sample: int = 0, integrator: str | None = None, variant: str | None = None, *,
          light_subpath: int | None = None, strategy: str = "", compare: bool = False, seed: int | None = None, size: tuple[int, int] | None = None,
          max_depth: int | None = None, backend: str | None = None, settings: Mapping[str, Any] | None = None) -> Trace:
    """One sample of a render again, on the CPU: vertices, densities, weights, contributions (docs/replay.md).

    `pixel` is (x, y) from (0, 0) at the top left; all that changes the image must be as in the render. `light_subpath` is shown too or, without `pixel`, alone;
    `strategy` such as "s1t3" leaves out the contributions of others; with `compare` the sample is rendered as well, and `by_segments` says where both part.
    Raises UsageError for a render that has no replay, and for a pixel or a light subpath that is not there.

    >>> trace = ambilux.trace(scene, (5, 7), sample=2, integrator="bdpt")
    >>> trace.pixel, trace.eye_subpath.vertices[0].depth, trace.complete
    ([5, 7], 1, True)
    """
    loaded = scene_of(scene, size)
    chosen = _core.Settings(loaded._core, assignments(settings, integrator=integrator, variant=variant, seed=seed, max_depth=max_depth, backend=backend))
    return traced(loaded._core, chosen, pixel, sample, light_subpath, strategy, compare)


def light_vertices(scene: Scene | str | os.PathLike[str], sample: int = 0, integrator: str = "bdpt", variant: str | None = None, *, seed: int | None = None,
                   size: tuple[int, int] | None = None, max_depth: int | None = None, settings: Mapping[str, Any] | None = None) -> Record:
    """Where the light subpaths of a sample met surfaces, as arrays of one row a vertex, in the order of light subpaths and depths.

    `position` (n, 3) float64 in coordinates of the scene's file; `normal`, `direction` (of the ray that arrived) and `throughput` (its power, as of one subpath
    alone: divide by `subpath_count`) (n, 3) float32; `depth` in segments from the light, `subpath` and `shape` (n,) uint32; `connectible` (n,) bool, False on mirrors
    and glass. The connectible ones are what the cache of variant lvc holds. Raises UsageError for a render without light subpaths or replay.

    >>> vertices = ambilux.light_vertices(scene, seed=1)
    >>> vertices.position.shape[1], int(vertices.depth.min()), vertices.subpath_count == 32 * 24
    (3, 1, True)
    """
    loaded = scene_of(scene, size)
    chosen = _core.Settings(loaded._core, assignments(settings, integrator=integrator, variant=variant, seed=seed, max_depth=max_depth))
    return Record(**_core.light_vertices(loaded._core, chosen, index("sample", sample)))


def guide(scene: Scene | str | os.PathLike[str], sample: int, integrator: str = "path", variant: str = "guided", *, point: Sequence[float] | None = None,
          seed: int | None = None, size: tuple[int, int] | None = None, max_depth: int | None = None, backend: str | None = None,
          settings: Mapping[str, Any] | None = None, side: str = "eye") -> Record:
    """What path guiding has learned when `sample` is rendered, as arrays: renders the iterations before it. Settings as in the render, `guide_samples` among them.

    Leaves of the tree over space: boxes `low` and `high` (n, 3) float64 in coordinates of the scene's file, `bsdf_share`, `reflected` (mean radiance that scattered
    rays bring), `depth` (n,), and `first` and `count` (n,): nodes of the quadtree over directions, none before light was found. Nodes: `probability` (m, 4) float32
    of the quadrants x + 2y of the unit square ((1 - cos θ)/2, φ/2π), and `child` (m, 4) int32: the node that a quadrant is, -1 for a cell. `statistics` sums up.
    `side` "light" has the tree of light subpaths (`guide_sides`). With `point`, `density` (64, 128) is a picture of what was learned there, times 4π; rows go by (1 - cos θ)/2 from +z, columns by φ.

    >>> tree = ambilux.guide(scene, 8, settings={"guide_samples": 4}, point=(0, 0, 0))
    >>> tree.low.shape == tree.high.shape == (len(tree.first), 3), abs(float(tree.density.mean()) - 1) < 0.05
    (True, True)
    """
    loaded = scene_of(scene, size)
    chosen = _core.Settings(loaded._core, assignments(settings, integrator=integrator, variant=variant, seed=seed, max_depth=max_depth, backend=backend))
    arrays = _core.guide(loaded._core, chosen, index("sample", sample), None if point is None else [float(c) for c in point], side)
    return Record(**{**arrays, "statistics": record(arrays["statistics"])})


def info(scene: Scene | str | os.PathLike[str], integrator: str | None = None, variant: str | None = None, *, size: tuple[int, int] | None = None,
         backend: str | None = None, settings: Mapping[str, Any] | None = None) -> Record:
    """`scene.info`, and what renders the scene: under `kernels` backend, device, features, what is skipped, bytes of memory; under `seconds` the time of each part.

    >>> ambilux.info(scene, "bdpt", backend="cpu").kernels.variant
    'wavefront'
    """
    loaded = scene_of(scene, size)
    return record(_core.info(loaded._core, _core.Settings(loaded._core, assignments(settings, integrator=integrator, variant=variant, backend=backend))))


def devices() -> Record:
    """The CUDA devices: `devices` with number, name, compute_capability, memory_bytes, kernels and problem; `toolkit`, `driver`, and `problem` where none can be used.

    >>> len(ambilux.devices().devices) == 0 or ambilux.devices().toolkit != ""
    True
    """
    return record(_core.devices())


def convert(scene: Scene | str | os.PathLike[str], path: str | os.PathLike[str]) -> None:
    """Writes a scene of any format as Mitsuba 3 XML, with meshes and images in a folder beside it, for other renderers. What Mitsuba takes in another way is a
    warning. `Scene.save` keeps the description of a scene instead. Raises UsageError for another ending than .xml, DeviceError if files cannot be written.

    >>> ambilux.convert(scene, OUT / "converted.xml")
    >>> ambilux.load(OUT / "converted.xml").size == scene.size
    True
    """
    name = os.fspath(path)
    if not name.endswith(".xml"):
        raise UsageError(f"{name}: Mitsuba scenes are written, whose names end in .xml")
    warn((f"{name}: {note}" for note in _core.convert(scene_of(scene, None)._core, name)), AmbiluxNote)


@dataclass(frozen=True)
class Sweep:
    """A stress sweep (docs/stress.md)."""

    folder: Path
    planned: int  #: rows
    bad: int  #: rows that failed, counted invalid values or were refused
    report: str  #: rows that are not ok, worst first
    csv: str  #: rows as stress.csv has them

    @property
    def rows(self) -> Any:
        """A frame of pandas: a row per cell, method and backend."""
        import pandas

        return pandas.read_csv(io.StringIO(self.csv))


def stress(out: str | os.PathLike[str], *, families: Sequence[str] = (), methods: Sequence[str] = (), backend: str = "auto", seed: int = 1, time: float = 0.0,
           quick: bool = False, resume: bool = False, quiet: bool = True) -> Sweep:
    """Renders generated scenes that are hard for floats, with known answers, by every method, into the folder `out`.

    `families` and `methods` leave out all others; `time` is in seconds, for the whole sweep. An interrupt saves what is finished; `resume=True` goes on. Raises
    UsageError for unknown names and for a folder that holds a sweep already.
    """
    if not time >= 0:
        raise UsageError(f"time {time}: seconds are needed, or 0 for no limit")
    chosen = names("families", families), names("methods", methods)
    csv, planned, bad, report = _core.stress(os.fspath(out), *chosen, backend, count("seed", seed), float(time), quick, resume, quiet)
    return Sweep(Path(out), planned, bad, report, csv)


def stress_families() -> dict[str, str]:
    """What the stress sweep varies, by the family's name.

    >>> ambilux.stress_families()["emission-scale"]
    'radiance of the lamp in a white cavity'
    """
    return {name: parameter for name, _, parameter in _core.stress_families()}


def stress_export(folder: str | os.PathLike[str], *, families: Sequence[str] = (), quick: bool = False) -> None:
    """Writes the scenes of the sweep as Mitsuba's XML, and expected.csv, for other renderers."""
    _core.stress_export(os.fspath(folder), names("families", families), quick)


def stress_judge(table: str | os.PathLike[str], out: str | os.PathLike[str]) -> Sweep:
    """Judges what another renderer measured on those scenes (the columns: docs/stress.md). Raises SceneError with file and line."""
    csv, planned, bad, report = _core.stress_judge(os.fspath(table), os.fspath(out))
    return Sweep(Path(out), planned, bad, report, csv)
