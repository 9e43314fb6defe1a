"""Values from NumPy and from what hands its memory over, such as PyTorch and CuPy."""

from __future__ import annotations

from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Scalars of NumPy and arrays of no dimension as Python has them, arrays of others as NumPy's; all else as it is."""
    if not isinstance(value, (np.ndarray, np.generic)) and hasattr(value, "__dlpack__"):
        if value.__dlpack_device__()[0] != 1:  # kDLCPU
            value = value.get() if hasattr(value, "get") else value.cpu()
        value = np.from_dlpack(value.detach() if hasattr(value, "detach") else value)
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return value.item()
    return value


def numbers_of(value: Any) -> np.ndarray | None:
    """A number, a sequence of numbers or an array of them as float64; None of anything else."""
    value = plain(value)
    if isinstance(value, (bool, str, bytes)) or value is None:
        return None
    try:
        array = np.asarray(getattr(value, "matrix", value))
    except (TypeError, ValueError):
        return None
    return array.astype(np.float64) if array.dtype.kind in "fiu" else None
