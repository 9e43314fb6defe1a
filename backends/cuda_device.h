// Whether there is a CUDA device to work on, and which kernels it gets. Callable in every build.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backends/kernel_choice.h"

namespace ambilux {

/// True if this build has the CUDA backend and its kernels run on the current device. False without a driver, without a
/// device, or on a device of another architecture. Never throws, never prints; the answer is kept.
bool cuda_device_present();

/// Seconds that the first look for a device took: the driver's start and its context.
double cuda_start_seconds();

/// Why cuda_device_present() is false, with CUDA's own word, and what helps.
std::string why_no_cuda_device();

/// Name of the current device; empty if cuda_device_present() is false.
std::string cuda_device_name();

/// PCI address of the current device, such as "0000:65:00.0", by which nvidia-smi knows it whatever
/// CUDA_VISIBLE_DEVICES says; empty if cuda_device_present() is false.
std::string cuda_device_bus_id();

/// Devices that this process sees; 0 if cuda_device_present() is false.
int cuda_device_count();

/// What the calling thread does from now on, it does on this device. Throws Error(device) that says how many there are.
void use_cuda_device(int device);

/// Of the current device; none if cuda_device_present() is false.
KernelChoice cuda_kernels();

/// False where the driver is older than graphs that loop and choose on the device (CUDA 12.8). Kernels are launched one
/// by one then, as with graph=false.
bool cuda_graphs_choose();

struct CudaDevice {
    int number = 0;  ///< for CUDA and --devices
    std::string name, bus_id;
    int capability = 0;
    uint64_t memory_bytes = 0;
    KernelChoice kernels;
    std::string problem;  ///< why it cannot be used, with CUDA's own word; empty if it can
};

struct CudaReport {
    std::string toolkit;  ///< the CUDA that built this, such as "13.0"; empty in a build without it
    BuiltFor built;
    std::string driver;       ///< of NVIDIA, such as "580.65.06"; empty if none is loaded
    std::string driver_cuda;  ///< the newest CUDA that it knows
    bool graphs = false;      ///< cuda_graphs_choose()
    std::string problem;      ///< as why_no_cuda_device(), of all devices; empty if one can be looked at
    std::vector<CudaDevice> devices;
};

/// Looks at all devices, each of which gets a context. Never throws.
CudaReport cuda_report();

}  // namespace ambilux
