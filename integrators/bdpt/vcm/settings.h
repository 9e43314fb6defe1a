// Settings of integrator vcm.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

struct VcmSettings {
    float radius = 0.003f;  ///< of the first iteration, over that of the scene's bounds
    float alpha = 0.75f;    ///< how fast it shrinks: r_i^2 = r_1^2 i^(alpha - 1); 1: not at all
    bool first = true;      ///< eye subpaths merge at their first vertex
    uint32_t samples = 1;   ///< of every pixel that share their light vertices

    static VcmSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
