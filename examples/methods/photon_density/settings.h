// Settings of integrator photon_density.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

namespace photon_density {

struct Settings {
    float radius = 0.01f;            ///< of the first iteration, over that of the scene's bounds
    float alpha = 0.75f;             ///< how fast it shrinks: r_i² = r_1² i^(alpha - 1); 1: not at all
    uint32_t iteration_samples = 1;  ///< samples of every pixel that share their photons

    static Settings plan(const RenderSettings& settings);
};

}  // namespace photon_density
}  // namespace ambilux
