// Settings of integrator vpl.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

struct VplSettings {
    static constexpr uint32_t kMostSubpaths = 1u << 16;

    uint32_t subpaths = 256;  ///< light subpaths of an iteration
    uint32_t samples = 1;     ///< of every pixel that share them
    uint32_t draws = 0;       ///< light vertices that an eye vertex draws, if there are more; 0: it takes all
    float clamp = 100.0f;  ///< bound of the geometry term of a connection, over 1 / (radius of the scene's bounds)^2;
                           ///< 0: none

    static VplSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
