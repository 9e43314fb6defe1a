"""Ambilux, a testbed for bidirectional light transport, from Python.

>>> import ambilux
>>> scene = ambilux.load(SCENES / "cornell.xml", size=(32, 24))
>>> image = ambilux.render(scene, integrator="bdpt", variant="lvc", spp=4, backend="cpu")
>>> image.rgb.shape, image.rgb.dtype.name, image.samples
((24, 32, 3), 'float32', 4)
"""

from typing import Any

try:
    from ambilux._core import cuda_available, git_revision, settings_help
    from ambilux._core import version as __version__
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
    from ambilux.commands import Sweep, convert, devices, guide, info, light_vertices, stress, stress_export, stress_families, stress_judge, trace
    from ambilux.errors import AmbiluxNote, AmbiluxWarning, DeviceError, SceneError, UsageError
    from ambilux.experiments import Progress, Results, experiment
    from ambilux.image import DeviceArray, Image, StrategyImage, compare, read
    from ambilux.params import Params
    from ambilux.records import Record
    from ambilux.rendering import Step, progressive, reference, render
    from ambilux.replays import Outlier, Trace
    from ambilux.scene import Scene, load

__all__ = ["AmbiluxNote", "AmbiluxWarning", "DeviceArray", "DeviceError", "Image", "Outlier", "Params", "Progress", "Record", "Results", "Scene", "SceneError", "Step", "StrategyImage",
           "Sweep", "Trace", "UsageError", "__version__", "compare", "convert", "cuda_available", "devices", "experiment", "git_revision", "guide", "info", "light_vertices", "load", "progressive",
           "read", "reference", "render", "settings_help", "stress", "stress_export", "stress_families", "stress_judge", "trace"]
