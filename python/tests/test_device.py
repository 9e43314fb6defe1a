"""Images that stay on a CUDA device. What needs one is skipped without."""

import subprocess
import sys

import ambilux
import pytest
from conftest import SCENES


def test_where_images_lie_is_checked(scene):
    with pytest.raises(ambilux.UsageError, match="cpu and cuda are known"):
        ambilux.render(scene, spp=1, device="tpu")
    for place in ({"backend": "cpu"}, {"settings": {"backend": "cpu"}}):
        with pytest.raises(ambilux.UsageError, match="has its images on the host"):
            ambilux.render(scene, spp=1, device="cuda", **place)
        with pytest.raises(ambilux.UsageError, match="has its images on the host"):
            ambilux.progressive(scene, spp=1, device="cuda", **place)
    assert ambilux.render(scene, spp=1, device="cpu", backend="cpu").on_device is None


@pytest.mark.skipif(ambilux.cuda_available(), reason="there is a CUDA device")
def test_without_a_device_it_is_refused(scene):
    with pytest.raises(ambilux.DeviceError):
        ambilux.render(scene, spp=1, device="cuda")


@pytest.mark.skipif(not ambilux.cuda_available(), reason="no CUDA device")
def test_arrays_on_the_device_are_the_image():
    check = SCENES.parent / "scripts/checks/check_device_arrays.py"
    done = subprocess.run([sys.executable, check, SCENES / "cornell.xml"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
