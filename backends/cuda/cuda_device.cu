#include "backends/cuda_device.h"

#include <cuda_runtime.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "core/error.h"
#include "core/seconds.h"

namespace ambilux {
namespace {

__global__ void probe_kernel() {}

struct Probe {
    cudaError_t error;
    double seconds;
};

const BuiltFor& built() {
    static const BuiltFor built = built_for(AMBILUX_BUILT_FOR);
    return built;
}

std::string version_text(int version) {
    return std::to_string(version / 1000) + "." + std::to_string(version % 1000 / 10);
}

/// 0 without a driver.
int driver_cuda() {
    int version = 0;
    if (cudaDriverGetVersion(&version) != cudaSuccess) version = 0;
    cudaGetLastError();
    return version;
}

/// Starts the context of the current device.
Probe probe() {
    const auto start = Clock::now();
    int count = 0;
    cudaFuncAttributes attributes;
    cudaError_t error = cudaGetDeviceCount(&count);
    if (error == cudaSuccess && count == 0) error = cudaErrorNoDevice;
    if (error == cudaSuccess) error = cudaFuncGetAttributes(&attributes, probe_kernel);
    cudaGetLastError();
    return {error, seconds_since(start)};
}

const Probe& first_probe() {
    static const Probe first = probe();
    return first;
}

std::string help_for(cudaError_t error) {
    const std::string toolkit = version_text(CUDART_VERSION);
    switch (error) {
        case cudaErrorInsufficientDriver:
            if (driver_cuda() == 0) return "no driver of NVIDIA is loaded: install one, and check it with nvidia-smi";
            return "the driver knows CUDA " + version_text(driver_cuda()) + ", and this program was built with " +
                   toolkit + ": update the driver";
        case cudaErrorNoDevice: return "nvidia-smi lists devices, and CUDA_VISIBLE_DEVICES may hide them";
        case cudaErrorMemoryAllocation:
            return "the device has no memory left for a context: end what else uses it (nvidia-smi lists it)";
        case cudaErrorDevicesUnavailable: return "another process has it for itself (nvidia-smi says its compute mode)";
        case cudaErrorNoKernelImageForDevice:
            return "this build has " + built_text(built()) +
                   ": build with AMBILUX_CUDA_ARCHITECTURES set to the device's compute capability (ambilux devices)";
        case cudaErrorUnsupportedPtxVersion:
            return "the driver cannot compile PTX of CUDA " + toolkit +
                   ": update it, or take machine code for the device";
        case cudaErrorJitCompilerNotFound:
        case cudaErrorJitCompilationDisabled:
            return "the driver has to compile PTX for this device: see CUDA_DISABLE_PTX_JIT and the driver's packages";
        default: return "check the driver with nvidia-smi";
    }
}

std::string reason(cudaError_t error) {
    return std::string(cudaGetErrorName(error)) + ", " + cudaGetErrorString(error) + ": " + help_for(error);
}

int capability_of(int device) {
    int major = 0, minor = 0;
    cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device);
    cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, device);
    return 10 * major + minor;
}

KernelChoice kernels_of(int device) {
    const char* const forced = std::getenv("CUDA_FORCE_PTX_JIT");
    return kernels_for(capability_of(device), built(), forced && std::atoi(forced) != 0);
}

/// "580.65.06" of "NVRM version: NVIDIA UNIX x86_64 Kernel Module  580.65.06  Sun Jul 27 ...".
std::string driver_version() {
    std::ifstream file("/proc/driver/nvidia/version");
    std::string line, word;
    std::getline(file, line);
    std::istringstream words(line);
    while (words >> word)
        if (word.find('.') != std::string::npos && word.find_first_not_of("0123456789.") == std::string::npos)
            return word;
    return {};
}

CudaDevice look_at(int number) {
    CudaDevice d;
    d.number = number;
    cudaDeviceProp properties;
    char id[32];
    cudaError_t error = cudaGetDeviceProperties(&properties, number);
    if (error == cudaSuccess) {
        d.name = properties.name;
        d.capability = 10 * properties.major + properties.minor;
        d.memory_bytes = properties.totalGlobalMem;
        d.kernels = kernels_of(number);
        if (cudaDeviceGetPCIBusId(id, sizeof id, number) == cudaSuccess) d.bus_id = id;
        error = cudaSetDevice(number);
    }
    if (error == cudaSuccess) error = probe().error;
    cudaGetLastError();
    if (error != cudaSuccess) d.problem = reason(error);
    return d;
}

}  // namespace

bool cuda_device_present() { return first_probe().error == cudaSuccess; }

double cuda_start_seconds() { return first_probe().seconds; }

std::string why_no_cuda_device() {
    return "no CUDA device answers: " + reason(first_probe().error) + "; or take backend cpu";
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
    if (count == 0) throw Error(ExitCode::device, why_no_cuda_device());
    if (device < 0 || device >= count)
        throw Error(ExitCode::device, "CUDA device " + std::to_string(device) + " is not there: this process sees " +
                                          std::to_string(count) + ", numbered from 0");
    const cudaError_t set = cudaSetDevice(device);
    cudaGetLastError();
    if (set != cudaSuccess)
        throw Error(ExitCode::device, "CUDA device " + std::to_string(device) + " cannot be used: " + reason(set));
}

KernelChoice cuda_kernels() {
    int device = 0;
    if (!cuda_device_present() || cudaGetDevice(&device) != cudaSuccess) return {};
    return kernels_of(device);
}

bool cuda_graphs_choose() {
    static const bool choose = driver_cuda() >= 12080;
    return choose;
}

CudaReport cuda_report() {
    CudaReport r;
    r.toolkit = version_text(CUDART_VERSION);
    r.built = built();
    r.driver = driver_version();
    if (const int version = driver_cuda()) r.driver_cuda = version_text(version);
    r.graphs = cuda_graphs_choose();
    int count = 0, current = 0;
    cudaError_t error = cudaGetDeviceCount(&count);
    if (error == cudaSuccess && count == 0) error = cudaErrorNoDevice;
    if (error == cudaSuccess) error = cudaGetDevice(&current);
    cudaGetLastError();
    if (error != cudaSuccess) {
        r.problem = reason(error);
        return r;
    }
    for (int i = 0; i < count; ++i) r.devices.push_back(look_at(i));
    cudaSetDevice(current);
    cudaGetLastError();
    return r;
}

}  // namespace ambilux
