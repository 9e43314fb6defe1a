// Whether tests of OptiX can run.
#pragma once

#include "backends/cuda_device.h"
#include "backends/optix.h"
#include "backends/trace_on_device.h"
#include "core/error.h"
#include "tests/support/skip.h"

namespace ambilux {

/// False where there is no device, no headers, or no library of the driver.
inline bool optix() {
    if (!cuda_device_present()) {
        skip("no CUDA device: skipped");
        return false;
    }
    if (!kOptixBuilt) {
        skip("built without OptiX: skipped");
        return false;
    }
    try {
        trace_by_optix(Scene(), {}, false);
    } catch (const Error& e) {
        if (std::string(e.what()).find("libnvoptix.so.1 was not found") == std::string::npos) throw;
        skip(std::string(e.what()) + ": skipped");
        return false;
    }
    return true;
}

}  // namespace ambilux
