"""Experiments and their results as pandas."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ambilux import _core
from ambilux.errors import SceneError


class Results:
    """The folder of an experiment. Each property is a frame of analysis.frames (needs pandas); columns: docs/experiments.md."""

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = Path(folder)

    def _frame(self, name: str) -> Any:
        from analysis import experiment, frames

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


def experiment(config: str | os.PathLike[str], out: str | os.PathLike[str], *, references: str | os.PathLike[str] = "", resume: bool = False,
               reduced: bool = False, quiet: bool = True) -> Results:
    """Runs an experiment as `ambilux experiment CONFIG -o OUT`. An interrupt saves what is finished; `resume=True` goes on."""
    _core.experiment(os.fspath(config), os.fspath(out), os.fspath(references), resume, reduced, quiet)
    return Results(out)
