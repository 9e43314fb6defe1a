"""Ambilux, a testbed for bidirectional light transport, from Python.

>>> import ambilux
>>> scene = ambilux.load(SCENES / "cornell.xml", size=(32, 24))
>>> image = ambilux.render(scene, integrator="bdpt", variant="lvc", spp=4, backend="cpu")
>>> image.rgb.shape, image.rgb.dtype.name, image.samples
((24, 32, 3), 'float32', 4)
"""

from ambilux._core import __version__, cuda_available, git_revision, settings_help
from ambilux.errors import AmbiluxWarning, DeviceError, SceneError, UsageError
from ambilux.experiments import Results, experiment
from ambilux.image import DeviceArray, Image, compare, read
from ambilux.params import Params
from ambilux.rendering import Step, progressive, reference, render
from ambilux.scene import Scene, load

__all__ = ["AmbiluxWarning", "DeviceArray", "DeviceError", "Image", "Params", "Results", "Scene", "SceneError", "Step", "UsageError", "__version__", "compare", "cuda_available",
           "experiment", "git_revision", "load", "progressive", "read", "reference", "render", "settings_help"]
