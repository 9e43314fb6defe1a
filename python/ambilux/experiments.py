"""Experiments and their results as pandas."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ambilux import _core
from ambilux.arrays import plain
from ambilux.errors import SceneError, UsageError


class Results:
    """The folder of an experiment. Each property is a frame of ambilux.analysis.frames (needs pandas); columns: docs/analysis.md, docs/experiments.md."""

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder)

    def _frame(self, name: str) -> Any:
        from ambilux.analysis import experiment, frames

        try:
            return getattr(frames, name)(self.folder)
        except experiment.InputError as e:
            raise SceneError(str(e)) from None

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
               resume: bool = False, reduced: bool = False, quiet: bool = True, dry_run: bool = False) -> Results | str:
    """Runs an experiment as `ambilux experiment CONFIG -o OUT`; `config` is a file or a dictionary of the same keys. An interrupt saves what is finished;
    `resume=True` goes on. Raises SceneError for what is wrong with the configuration or a scene, with file and line.
    With `dry_run` it says what would be done, and with which time and memory, and writes nothing."""
    with config_file(config) as path:
        if dry_run:
            return _core.plan(path, reduced)
        if out is None:
            raise UsageError("an experiment needs a folder for its results, unless dry_run is True")
        _core.experiment(path, os.fspath(out), os.fspath(references), resume, reduced, quiet)
    return Results(out)
