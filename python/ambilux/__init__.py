"""Ambilux, a testbed for bidirectional light transport, from Python.

>>> import ambilux
>>> scene = ambilux.load(SCENES / "cornell.xml", size=(32, 24))
>>> image = ambilux.render(scene, integrator="bdpt", variant="lvc", spp=4, backend="cpu")
>>> image.rgb.shape, image.rgb.dtype.name, image.samples
((24, 32, 3), 'float32', 4)
"""

from typing import Any

try:
    from ambilux._core import __version__, cuda_available, git_revision, settings_help
except ModuleNotFoundError as error:
    if error.name != "ambilux._core":
        raise

    def __getattr__(name: str) -> Any:
        """The analysis needs Python alone, and works without what renders."""
        if name not in __all__:
            raise AttributeError(f"module 'ambilux' has no attribute '{name}'")
        raise ImportError(f"ambilux.{name} needs the compiled module ambilux._core, which is not built here: `pip install .` installs it, and scripts/build.sh puts it "
                          "into build/python (PYTHONPATH=build/python)")
else:
    from ambilux.errors import AmbiluxWarning, DeviceError, SceneError, UsageError
    from ambilux.experiments import Results, experiment
    from ambilux.image import DeviceArray, Image, compare, read
    from ambilux.params import Params
    from ambilux.rendering import Step, progressive, reference, render
    from ambilux.scene import Scene, load

__all__ = ["AmbiluxWarning", "DeviceArray", "DeviceError", "Image", "Params", "Results", "Scene", "SceneError", "Step", "UsageError", "__version__", "compare", "cuda_available",
           "experiment", "git_revision", "load", "progressive", "read", "reference", "render", "settings_help"]
