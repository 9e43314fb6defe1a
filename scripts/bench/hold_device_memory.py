#!/usr/bin/env python3
"""Takes memory of the first CUDA device until its standard input ends, so that only so much is left for others.

    scripts/bench/hold_device_memory.py LEFT_MIB

Needs the driver's library alone.
"""

import ctypes
import sys


def main():
    left = int(sys.argv[1]) << 20
    cuda = ctypes.CDLL("libcuda.so.1")

    def call(name, *arguments):
        if code := getattr(cuda, name)(*arguments):
            sys.exit(f"{name}: error {code}")

    device, context, pointer = ctypes.c_int(), ctypes.c_void_p(), ctypes.c_uint64()
    free, total = ctypes.c_size_t(), ctypes.c_size_t()
    call("cuInit", 0)
    call("cuDeviceGet", ctypes.byref(device), 0)
    call("cuDevicePrimaryCtxRetain", ctypes.byref(context), device)
    call("cuCtxSetCurrent", context)
    call("cuMemGetInfo_v2", ctypes.byref(free), ctypes.byref(total))
    if free.value > left:
        call("cuMemAlloc_v2", ctypes.byref(pointer), ctypes.c_size_t(free.value - left))
    print(f"{free.value >> 20} MiB were free, {left >> 20} are left", flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main()
