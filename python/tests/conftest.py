"""Tests of the package ambilux. scripts/test.sh puts the built module on PYTHONPATH; an installed one does as well."""

from pathlib import Path

import pytest

SCENES = Path(__file__).parents[2] / "scenes"

BALL = {
    "type": "scene",
    "sensor": {"type": "perspective", "fov": 40.0, "to_world": {"look_at": {"origin": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0]}},
               "film": {"type": "hdrfilm", "width": 16, "height": 12, "rfilter": {"type": "box"}}},
    "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.4, 0.3]}}},
    "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 2.0}},
}


@pytest.fixture(scope="session")
def scene():
    import ambilux

    return ambilux.load(SCENES / "cornell.xml", size=(32, 24))
