// Settings of integrator lpv.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;
struct Scene;

namespace lpv {

constexpr uint32_t kMostCascades = 6;

struct Settings {
    uint32_t cascades = 3;           ///< nested grids, each with half the edge of the one around it
    uint32_t resolution = 32;        ///< cells of a grid along an axis
    uint32_t steps = 32;             ///< of propagation
    float size = 1.0f;               ///< edge of the largest grid, over that of the cube around all surfaces
    float occlusion = 1.0f;          ///< share of the blocked flux that is held back; 0: nothing blocks
    uint32_t iteration_samples = 1;  ///< samples of every pixel that share their virtual lights

    static Settings plan(const RenderSettings& settings);
    /// Virtual lights of an iteration. Throws Error(usage) if those of all grids cannot be numbered.
    uint32_t lights(const Scene& scene) const;
};

}  // namespace lpv
}  // namespace ambilux
