// Whether this build has OptiX as a tracer (cmake/dependencies.cmake).
#pragma once

namespace ambilux {

#if defined(AMBILUX_HAS_OPTIX)
constexpr bool kOptixBuilt = true;
#else
constexpr bool kOptixBuilt = false;
#endif

constexpr const char* kWhyNoOptix =
    "accel=optix: this program was built without OptiX: configure it with OptiX_ROOT, the folder of NVIDIA's headers "
    "(docs/building.md), or take accel=cwbvh";

}  // namespace ambilux
