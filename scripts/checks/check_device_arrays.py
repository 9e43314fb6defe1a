#!/usr/bin/env python3
"""Whether images that stay on a CUDA device are what others get by DLPack: values, layout, lifetime.

    scripts/checks/check_device_arrays.py [SCENE.xml]

Needs the package ambilux with CUDA, NumPy and the driver; PyTorch and CuPy are tried where they are installed.
"""

import ctypes
import gc
import importlib.util
import pathlib
import sys

import ambilux
import numpy as np

CUDA_DEVICE = 2  # kDLCUDA
FLOAT32 = (2, 32, 1)  # kDLFloat, bits, lanes


class Tensor(ctypes.Structure):
    """DLTensor."""

    _fields_ = [("data", ctypes.c_void_p), ("device_type", ctypes.c_int32), ("device", ctypes.c_int32), ("ndim", ctypes.c_int32), ("code", ctypes.c_uint8),
                ("bits", ctypes.c_uint8), ("lanes", ctypes.c_uint16), ("shape", ctypes.POINTER(ctypes.c_int64)), ("strides", ctypes.POINTER(ctypes.c_int64)),
                ("byte_offset", ctypes.c_uint64)]


class VersionedTensor(ctypes.Structure):
    """DLManagedTensorVersioned."""

    _fields_ = [("major", ctypes.c_uint32), ("minor", ctypes.c_uint32), ("context", ctypes.c_void_p), ("deleter", ctypes.c_void_p), ("flags", ctypes.c_uint64),
                ("tensor", Tensor)]


def tensor_of(capsule):
    get = ctypes.pythonapi.PyCapsule_GetPointer
    get.restype, get.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    try:
        return Tensor.from_address(get(capsule, b"dltensor"))
    except ValueError:
        return VersionedTensor.from_address(get(capsule, b"dltensor_versioned")).tensor


class Driver:
    def __init__(self):
        self.cuda = ctypes.CDLL("libcuda.so.1")
        device, context = ctypes.c_int(), ctypes.c_void_p()
        self.call("cuInit", 0)
        self.call("cuDeviceGet", ctypes.byref(device), 0)
        self.call("cuDevicePrimaryCtxRetain", ctypes.byref(context), device)
        self.call("cuCtxSetCurrent", context)

    def call(self, name, *arguments):
        code = getattr(self.cuda, name)(*arguments)
        assert code == 0, f"{name}: error {code}"

    def download(self, pointer, shape):
        host = np.empty(shape, np.float32)
        self.call("cuMemcpyDtoH_v2", ctypes.c_void_p(host.ctypes.data), ctypes.c_uint64(pointer), ctypes.c_size_t(host.nbytes))
        return host

    def free_bytes(self):
        free, total = ctypes.c_size_t(), ctypes.c_size_t()
        self.call("cuMemGetInfo_v2", ctypes.byref(free), ctypes.byref(total))
        return free.value


def check_layout(tensor, height, width):
    assert (tensor.device_type, tensor.device) == (CUDA_DEVICE, 0)
    assert (tensor.code, tensor.bits, tensor.lanes) == FLOAT32
    assert tensor.ndim == 3 and tuple(tensor.shape[:3]) == (height, width, 3)
    assert not tensor.strides or tuple(tensor.strides[:3]) == (3 * width, 3, 1)


def check_values(driver, scene):
    for integrator in ("path", "bdpt"):
        image = ambilux.render(scene, integrator, spp=4, size=(67, 45), device="cuda")
        array, rgb = image.on_device, image.rgb
        assert array.shape == rgb.shape and array.dtype == rgb.dtype and array.device == "cuda:0"
        assert array.__dlpack_device__() == (CUDA_DEVICE, 0)
        interface = array.__cuda_array_interface__
        assert interface["shape"] == rgb.shape and interface["typestr"] == "<f4"
        for capsule in (array.__dlpack__(), array.__dlpack__(stream=1), array.__dlpack__(max_version=(1, 0), copy=False)):
            tensor = tensor_of(capsule)
            check_layout(tensor, 45, 67)
            assert tensor.data + tensor.byte_offset == interface["data"][0]
        # The capsule alone keeps the memory.
        del array, interface
        image = None
        gc.collect()
        assert np.array_equal(driver.download(tensor.data + tensor.byte_offset, rgb.shape), rgb)


def check_steps(driver, scene):
    steps = list(ambilux.progressive(scene, time=0.3, every=0.05, size=(64, 48), device="cuda"))
    assert len(steps) > 1
    for step in steps:  # each as it was
        pointer, _ = step.image.on_device.__cuda_array_interface__["data"]
        assert np.array_equal(driver.download(pointer, step.image.shape), step.image.rgb)


def check_memory(driver, scene):
    side = 2048
    image = ambilux.render(scene, spp=1, size=(side, side), device="cuda")
    capsule = image.on_device.__dlpack__()
    del image
    gc.collect()
    held = driver.free_bytes()
    del capsule
    gc.collect()
    assert driver.free_bytes() - held >= 12 * side**2 // 2, "the image is not freed"


def check_refusals(scene):
    for arguments in ({"device": "tpu"}, {"device": "cuda", "backend": "cpu"}):
        try:
            ambilux.render(scene, spp=1, size=(8, 8), **arguments)
        except ambilux.UsageError:
            continue
        raise AssertionError(arguments)
    assert ambilux.render(scene, spp=1, size=(8, 8), backend="cuda").on_device is None


def check_packages(scene):
    image = ambilux.render(scene, spp=4, size=(32, 24), device="cuda")
    pointer = image.on_device.__cuda_array_interface__["data"][0]
    tried = []
    if importlib.util.find_spec("torch"):
        import torch

        tensor = torch.from_dlpack(image.on_device)
        assert tensor.is_cuda and tensor.data_ptr() == pointer and np.array_equal(tensor.cpu().numpy(), image.rgb)
        tried.append("PyTorch")
    if importlib.util.find_spec("cupy"):
        import cupy

        for array in (cupy.from_dlpack(image.on_device), cupy.asarray(image.on_device)):
            assert array.data.ptr == pointer and np.array_equal(array.get(), image.rgb)
        tried.append("CuPy")
    return tried


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parents[2] / "scenes/cornell.xml"
    scene = ambilux.load(path)
    driver = Driver()
    check_values(driver, scene)
    check_steps(driver, scene)
    check_memory(driver, scene)
    check_refusals(scene)
    print("arrays on the device: all right" + "".join(f", {name} too" for name in check_packages(scene)))


if __name__ == "__main__":
    main()
