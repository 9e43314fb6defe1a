"""Images as arrays, their files, and their error."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ambilux import _core
from ambilux.errors import UsageError
from ambilux.records import Record
from ambilux.replays import Outlier


class DeviceArray:
    """The values of `Image.rgb` in the memory of a CUDA device: float32 of height x width x 3.

    PyTorch, CuPy and others see the same memory, without a copy: torch.from_dlpack(array), cupy.from_dlpack(array), cupy.asarray(array). It is finished,
    whichever stream reads it, and lives as long as any of them.
    """

    dtype = np.dtype(np.float32)

    def __init__(self, core: _core.DeviceImage):
        self._core = core

    @property
    def shape(self) -> tuple[int, int, int]:
        width, height = self._core.size
        return height, width, 3

    @property
    def device(self) -> str:
        return f"cuda:{self._core.device}"

    def __dlpack__(self, *, stream: Any = None, max_version: tuple[int, int] | None = None, dl_device: tuple[int, int] | None = None,
                   copy: bool | None = None) -> Any:
        if copy or dl_device not in (None, self.__dlpack_device__()):
            raise BufferError("an array on the device is handed over as it is: copy it there")
        return self._core.dlpack()

    def __dlpack_device__(self) -> tuple[int, int]:
        return 2, self._core.device  # kDLCUDA

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return {"version": 3, "shape": self.shape, "typestr": self.dtype.str, "data": (self._core.pointer, False), "strides": None, "stream": None}

    def __repr__(self) -> str:
        return f"<ambilux.DeviceArray {self.shape[1]}x{self.shape[0]} on {self.device}>"


@dataclass(frozen=True)
class StrategyImage:
    """What one strategy found, mean over all samples."""

    s: int  #: vertices of the light subpath
    t: int  #: vertices of the eye subpath
    merge: bool  #: both subpaths end at one vertex, which s and t both count
    raw: np.ndarray = field(repr=False)  #: float32 of height x width x 3, without the weight of multiple importance sampling
    weighted: np.ndarray = field(repr=False)  #: with it: these of all strategies add up to the light of all paths up to technique_depth segments
    dropped: int  #: values left out as not finite


class Image:
    """Linear Rec.709 radiance: `rgb`, float32 of height x width x 3, row by row from the top left.

    NumPy, PyTorch and others see the same memory, without a copy: numpy.asarray(image), torch.from_dlpack(image).

    >>> image = ambilux.render(scene, spp=4)
    >>> numpy.shares_memory(numpy.from_dlpack(image), image.rgb)
    True
    """

    def __init__(self, rgb: Any, stderr: Any = None, samples: int = 0, stats: Record | None = None, attributes: dict[str, Any] | None = None,
                 on_device: DeviceArray | None = None):
        self.rgb = pixels(rgb)
        #: Standard error of every value; None where it is not known.
        self.stderr = None if stderr is None else pixels(stderr)
        if self.stderr is not None and self.stderr.shape != self.rgb.shape:
            raise UsageError(f"standard errors of shape {self.stderr.shape} do not belong to an image of {self.rgb.shape}")
        #: Per pixel; 0 if it is not known.
        self.samples = samples
        #: Of the render, as `ambilux render --json` writes them.
        self.stats: Record = stats or Record()
        #: What made the image, for the header of its file.
        self.attributes = attributes or {}
        #: The same values on the device that rendered them, where `device` asked for them; else None.
        self.on_device = on_device
        #: One a strategy, where `technique_images` asked for them.
        self.strategies: list[StrategyImage] = []
        #: The largest first, where `outliers` asked for them.
        self.outliers: list[Outlier] = []
        self._layers: list[_core.Layer] = []

    @classmethod
    def _of(cls, core: _core.Pixels, **more: Any) -> Image:
        return cls(core.rgb, core.stderr if core.samples > 1 else None, core.samples, **more)

    @property
    def variance(self) -> np.ndarray | None:
        """Of one sample of every value; None where it is not known."""
        return None if self.stderr is None else self.stderr**2 * np.float32(self.samples)

    @property
    def aovs(self) -> dict[str, np.ndarray]:
        """Layers that `aovs` asked for, by name: float32 of height x width, or of height x width x 3. Views, which keep the image's memory."""
        arrays = {layer.name: layer.array(self.shape[0]) for layer in self._layers}
        return {name: array[..., 0] if array.shape[2] == 1 else array for name, array in arrays.items()}

    @property
    def shape(self) -> tuple[int, ...]:
        """Height, width, 3."""
        return self.rgb.shape

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        if dtype is not None and np.dtype(dtype) != self.rgb.dtype:
            if copy is False:
                raise ValueError(f"an image is of float32; as {np.dtype(dtype)} it is copied")
            return self.rgb.astype(dtype)
        return self.rgb.copy() if copy else self.rgb

    def __dlpack__(self, **options: Any) -> Any:
        return self.rgb.__dlpack__(**options)

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.rgb.__dlpack_device__()

    def __repr__(self) -> str:
        return f"<ambilux.Image {self.shape[1]}x{self.shape[0]}, {self.samples} spp>"

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            self.save(os.path.join(folder, "image.png"))
            return Path(folder, "image.png").read_bytes()

    def save(self, path: str | os.PathLike[str], *, exposure: float = 0.0, stderr: bool = False) -> None:
        """Writes an EXR file with the layers of `aovs`, with `stderr` one without them that `compare` takes as reference, or a PNG `exposure` stops brighter.

        Raises UsageError for another ending, DeviceError if the file cannot be written.
        """
        name = os.fspath(path)
        os.makedirs(os.path.dirname(name) or ".", exist_ok=True)
        if name.lower().endswith(".png"):
            if not abs(exposure) <= 100:
                raise UsageError(f"exposure {exposure}: 100 stops at most, up or down")
            _core.write_png(name, self.rgb, exposure)
        elif name.lower().endswith(".exr"):
            if stderr and self.stderr is None:
                raise UsageError("the image has no standard errors")
            _core.write_image(name, self.rgb, self.stderr if stderr else None, self.samples, json.dumps(self.attributes), self._layers)
        else:
            raise UsageError(f"{name}: .exr and .png are known")


def pixels(value: Any) -> np.ndarray:
    given = np.asarray(value)
    if given.dtype.kind != "f":
        raise UsageError(f"an image holds floats, linear radiance, not {given.dtype}")
    array = np.ascontiguousarray(given, dtype=np.float32)
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise UsageError(f"an image has the shape (height, width, 3), not {array.shape}")
    return array


def read(path: str | os.PathLike[str]) -> Image:
    """Reads an EXR file; a reference with its standard errors. float32 of height x width x 3. Raises SceneError that names the file and what is wrong with it."""
    core, attributes = _core.read_image(os.fspath(path))
    stated = json.loads(attributes)
    image = Image(core.rgb, core.stderr, core.samples, attributes=stated)
    if not image.samples and isinstance(stated.get("spp"), int):
        image.samples = stated["spp"]
    return image


def as_image(value: Any) -> Image:
    if isinstance(value, Image):
        return value
    if isinstance(value, (str, os.PathLike)):
        return read(value)
    return Image(value)


def compare(image: Any, reference: Any) -> dict[str, float | None]:
    """Error of an image against a reference: the figures of `ambilux compare --json`, None where they are not known.

    Both may be images, arrays of height x width x 3 or names of EXR files. RMSE and bias have the unit of the images, relMSE and MAPE none; `bias_z` counts standard
    errors (docs/experiments.md). Do not take images of equal seeds: what they share is no error of either. Raises UsageError for different sizes.

    >>> one, other = (ambilux.render(scene, spp=4, seed=seed) for seed in (1, 2))
    >>> metrics = ambilux.compare(one, other)
    >>> metrics["rmse_corrected"] <= metrics["rmse"], abs(metrics["bias_z"]) < 5
    (True, True)
    """
    one, other = as_image(image), as_image(reference)
    if one.shape != other.shape:
        raise UsageError(f"the image is {one.shape[1]}x{one.shape[0]}, the reference {other.shape[1]}x{other.shape[0]}: render both at the same size")
    metrics: dict[str, float | None] = json.loads(_core.compare(one.rgb, other.rgb, other.stderr, other.samples))
    return metrics
