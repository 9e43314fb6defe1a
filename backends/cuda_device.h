// Whether there is a CUDA device to work on. Callable in every build.
#pragma once

#include <string>

namespace ambilux {

/// True if this build has the CUDA backend and its kernels run on the current device. False without a driver, without a
/// device, or on a device of another architecture. Never throws, never prints; the answer is kept.
bool cuda_device_present();

/// What cuda_device_present() being false means, and what helps.
const char* why_no_cuda_device();

/// Name of the current device; empty if cuda_device_present() is false.
std::string cuda_device_name();

/// PCI address of the current device, such as "0000:65:00.0", by which nvidia-smi knows it whatever
/// CUDA_VISIBLE_DEVICES says; empty if cuda_device_present() is false.
std::string cuda_device_bus_id();

/// Devices that this process sees; 0 if cuda_device_present() is false.
int cuda_device_count();

/// What the calling thread does from now on, it does on this device. Throws Error(device) that says how many there are.
void use_cuda_device(int device);

}  // namespace ambilux
