"""Experiments and their results as pandas."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial, update_wrapper
from pathlib import Path
from typing import Any

from ambilux import _core
from ambilux.arrays import plain
from ambilux.errors import SceneError, UsageError


@dataclass(frozen=True)
class Progress:
    """Where an experiment stands."""

    fraction: float  #: done, in [0, 1]; of the time that all is expected to take
    details: str  #: what is in work, such as "glass, lvc, seed 2"
    seconds_left: float  #: negative: not known


class Plots:
    """The functions of ambilux.analysis.plots with these results as their data: `results.plot.convergence(x="spp")` is a figure of matplotlib."""

    def __init__(self, results: Results):
        self._results = results

    def __dir__(self) -> list[str]:
        from ambilux.analysis import plots

        return [name for name in plots.__all__ if name not in ("NotMade", "load", "save")]

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_") or name not in dir(self):
            raise AttributeError(f"no plot {name}; there are {', '.join(dir(self))}")
        from ambilux.analysis import plots

        draw = getattr(plots, name)
        return update_wrapper(partial(draw, self._results.data), draw)


class Results:
    """The folder of an experiment. Properties are frames of pandas (ambilux.analysis.frames; columns: docs/analysis.md), `plot` has the figures."""

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder)

    @property
    def plot(self) -> Plots:
        """Figures of matplotlib; `dir(results.plot)` names them."""
        return Plots(self)

    @property
    def data(self) -> Any:
        """What the functions of ambilux.analysis work on."""
        from ambilux.analysis import experiment

        try:
            return experiment.load(self.folder)
        except experiment.InputError as e:
            raise SceneError(str(e)) from None

    def _frame(self, name: str) -> Any:
        from ambilux.analysis import frames

        return getattr(frames, name)(self.data)

    @property
    def runs(self) -> Any:
        """A row per scene, run, seed and checkpoint."""
        return self._frame("runs")

    @property
    def table(self) -> Any:
        """A row per scene and run: efficiencies, ratios, intervals."""
        return self._frame("table")

    @property
    def stages(self) -> Any:
        """A row per scene, run, seed and stage."""
        return self._frame("stages")

    @property
    def batches(self) -> Any:
        """A row per batch of passes."""
        return self._frame("batches")

    @property
    def depths(self) -> Any:
        """A row per scene, run, seed, stage and depth."""
        return self._frame("depths")

    @property
    def queues(self) -> Any:
        """A row per scene, run, seed and queue."""
        return self._frame("queues")

    @property
    def selections(self) -> Any:
        """A row per scene, run, seed and candidate of bdpt.auto."""
        return self._frame("selections")

    @property
    def strategies(self) -> Any:
        """A row per scene, run and strategy; for runs with `techniques`."""
        return self._frame("strategies")

    def __repr__(self) -> str:
        return f"<ambilux.Results {self.folder}>"

    def _repr_html_(self) -> str:
        return str(self.table.to_html(index=False))


def toml_text(value: Any) -> str:
    """A value as TOML has it in one line."""
    value = plain(value)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(str(k))} = {toml_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_text, value)) + "]"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str) or hasattr(value, "__fspath__"):
        return json.dumps(os.fspath(value))
    raise UsageError(f"{value!r}: a configuration has texts, numbers, truth values, lists and dictionaries")


@contextlib.contextmanager
def config_file(config: str | os.PathLike[str] | Mapping[str, Any]) -> Iterator[str]:
    """The file of a configuration, which is written if it is a dictionary; names of files in that are those of this process."""
    if not isinstance(config, Mapping):
        yield os.fspath(config)
        return
    scenes = [{**s, "path": os.path.abspath(s["path"])} if isinstance(s, Mapping) and "path" in s else s for s in config.get("scene", [])]
    lines = [f"{json.dumps(str(k))} = {toml_text(v)}" for k, v in {**config, "scene": scenes}.items()]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"{config.get('name', 'experiment')}.toml")
        path.write_text("\n".join(lines) + "\n")
        yield str(path)


def experiment(config: str | os.PathLike[str] | Mapping[str, Any], out: str | os.PathLike[str] | None = None, *, references: str | os.PathLike[str] = "",
               resume: bool = False, reduced: bool = False, quiet: bool = True, dry_run: bool = False,
               progress: Callable[[Progress], Any] | None = None) -> Results | str:
    """Runs an experiment as `ambilux experiment CONFIG -o OUT`; `config` is a file or a dictionary of the same keys. An interrupt saves what is finished;
    `resume=True` goes on. Raises SceneError for what is wrong with the configuration or a scene, with file and line.
    With `dry_run` it says what would be done, and with which time and memory, and writes nothing. `progress` is called up to twenty times a second, on the
    thread that called; what it raises ends the experiment as an interrupt does."""
    with config_file(config) as path:
        if dry_run:
            return _core.plan(path, os.fspath(references), reduced)
        if out is None:
            raise UsageError("an experiment needs a folder for its results, unless dry_run is True")
        _core.experiment(path, os.fspath(out), os.fspath(references), resume, reduced, quiet,
                         progress and (lambda *report: progress(Progress(*report))))
    return Results(out)
