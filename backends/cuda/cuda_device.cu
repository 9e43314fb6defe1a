#include "backends/cuda_device.h"

#include <cuda_runtime.h>

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

std::string cuda_device_name() {
    int device = 0;
    cudaDeviceProp properties;
    if (!cuda_device_present() || cudaGetDevice(&device) != cudaSuccess ||
        cudaGetDeviceProperties(&properties, device) != cudaSuccess)
        return {};
    return properties.name;
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

}  // namespace ambilux
