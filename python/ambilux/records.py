"""Named values, such as the statistics of a render."""

from __future__ import annotations

import json
import pprint
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

from ambilux import _core


class Record(SimpleNamespace):
    """Named values as attributes and by name; those inside of them are records too, and lists of records.

    `vars(record)` is a dictionary of one level, as pandas.DataFrame(map(vars, image.stats.stages)) takes them; `to_dict()` has dictionaries on all levels.

    >>> stats = ambilux.render(scene, spp=2).stats
    >>> stats.spp, stats["seconds"]["render"] == stats.seconds.render, "stages" in stats
    (2, True, True)
    """

    def __getattr__(self, name: str) -> Any:
        near = _core.nearest_name(list(vars(self)), name)
        raise AttributeError(f"no value {name!r} here" + (f": did you mean {near!r}?" if near else ""))

    def __getitem__(self, name: str) -> Any:
        if name not in vars(self):
            raise KeyError(name)
        return vars(self)[name]

    def __contains__(self, name: object) -> bool:
        return name in vars(self)

    def __iter__(self) -> Iterator[str]:
        return iter(vars(self))

    def __eq__(self, other: object) -> bool:
        return self.to_dict() == (other.to_dict() if isinstance(other, Record) else other)

    def to_dict(self) -> dict[str, Any]:
        """Of dictionaries, lists, texts and numbers alone."""
        return {name: plain(value) for name, value in vars(self).items()}

    def __repr__(self) -> str:
        return pprint.pformat(self.to_dict(), width=120, compact=True, sort_dicts=False)


def plain(value: Any) -> Any:
    if isinstance(value, list):
        return [plain(v) for v in value]
    return value.to_dict() if isinstance(value, Record) else value


def record(text: str) -> Record:
    """Of the JSON text of an object."""
    made = json.loads(text, object_hook=lambda values: Record(**values))
    assert isinstance(made, Record)
    return made
