// The CUDA devices of a machine, for people and for programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "backends/cuda_device.h"

namespace ambilux {

/// In lines.
std::string devices_text(const CudaReport& report);

/// toolkit, kernels, driver, driver_cuda, graphs, problem, and devices {number, name, bus_id, compute_capability,
/// memory_bytes, kernels, problem}.
nlohmann::json devices_json(const CudaReport& report);

}  // namespace ambilux
