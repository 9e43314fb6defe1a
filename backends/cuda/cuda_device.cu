#include "backends/cuda_device.h"

#include <cuda_runtime.h>

#include "core/error.h"

namespace ambilux {
namespace {

__global__ void probe_kernel() {}

bool probe() {
    int count = 0;
    cudaFuncAttributes attributes;
    const bool present = cudaGetDeviceCount(&count) == cudaSuccess && count > 0 &&
                         cudaFuncGetAttributes(&attributes, probe_kernel) == cudaSuccess;
    cudaGetLastError();
    return present;
}

}  // namespace

bool cuda_device_present() {
    static const bool present = probe();
    return present;
}

const char* why_no_cuda_device() {
    return "no CUDA device answers: check the driver with nvidia-smi, or take backend cpu";
}

std::string cuda_device_name() {
    int device = 0;
    cudaDeviceProp properties;
    if (!cuda_device_present()) return {};
    const bool known =
        cudaGetDevice(&device) == cudaSuccess && cudaGetDeviceProperties(&properties, device) == cudaSuccess;
    cudaGetLastError();
    return known ? properties.name : "";
}

std::string cuda_device_bus_id() {
    int device = 0;
    char id[32];
    if (!cuda_device_present()) return {};
    const bool known =
        cudaGetDevice(&device) == cudaSuccess && cudaDeviceGetPCIBusId(id, sizeof id, device) == cudaSuccess;
    cudaGetLastError();
    return known ? id : "";
}

int cuda_device_count() {
    int count = 0;
    if (!cuda_device_present()) return 0;
    const bool known = cudaGetDeviceCount(&count) == cudaSuccess;
    cudaGetLastError();
    return known ? count : 0;
}

void use_cuda_device(int device) {
    const int count = cuda_device_count();
    if (device < 0 || device >= count)
        throw Error(ExitCode::device, "CUDA device " + std::to_string(device) + " is not there: this process sees " +
                                          std::to_string(count) + ", numbered from 0");
    const cudaError_t set = cudaSetDevice(device);
    cudaGetLastError();
    if (set != cudaSuccess)
        throw Error(ExitCode::device,
                    "CUDA device " + std::to_string(device) + " cannot be used: " + cudaGetErrorString(set));
}

}  // namespace ambilux
