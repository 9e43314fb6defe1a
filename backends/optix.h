// Whether this build has OptiX as a tracer (cmake/dependencies.cmake), and what is known of it.
#pragma once

#include <cstdint>

namespace ambilux {

#if defined(AMBILUX_HAS_OPTIX)
constexpr bool kOptixBuilt = true;
#else
constexpr bool kOptixBuilt = false;
#endif

constexpr const char* kWhyNoOptix =
    "accel=optix: this program was built without OptiX: configure it with OptiX_ROOT, the folder of NVIDIA's headers "
    "(docs/building.md), or take accel=cwbvh";

struct OptixFacts {
    uint64_t bytes = 0;  ///< on the device: the structure, and what launches take for stacks
    uint64_t peak_bytes = 0, predicted_peak_bytes = 0;  ///< of the structure while it is built
    double build_seconds = 0;
};

}  // namespace ambilux
