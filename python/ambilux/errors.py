"""What goes wrong. An interrupted render raises KeyboardInterrupt."""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Iterable


class UsageError(ValueError):
    """A value that is not allowed: exit code 2 of the program."""


class SceneError(Exception):
    """What is wrong with a file or a dictionary: exit code 3 of the program.

    `file` and `line` say where; `line` is 0 and `file` is empty where there is none. Of a scene from a dictionary `key` is the path of keys, such as "floor.bsdf.reflectance".
    """

    def __init__(self, message: str, key: str = ""):
        super().__init__(message)
        # As all messages about files begin (core/error.h).
        place = None if key else re.match(r"(.*?):(?:(\d+):)? ", message, re.DOTALL)
        self.file: str = place[1] if place else ""
        self.line: int = int(place[2] or 0) if place else 0
        self.key = key


class DeviceError(RuntimeError):
    """A device, file system or other resource failed: exit code 4 of the program."""


class AmbiluxWarning(UserWarning):
    """What an image lacks or lost, and what was replaced in a scene."""


class AmbiluxNote(AmbiluxWarning):
    """What is done in another way than a scene says, with the same image, or with the one that it is known for."""


def warn(texts: Iterable[str], kind: type[AmbiluxWarning] = AmbiluxWarning) -> None:
    """As warnings of the line outside of this package that led here, so that Python says each once a line."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and os.path.dirname(frame.f_code.co_filename) == os.path.dirname(__file__):
        level, frame = level + 1, frame.f_back
    for text in texts:
        warnings.warn(text, kind, stacklevel=level)
