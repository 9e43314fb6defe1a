// Settings of integrator vcm.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

/// That of the papers.
constexpr float kUsualRadius = 0.003f;
/// Floats tell places in a scene apart down to some 1e-7 of its radius.
constexpr float kLeastRadius = 1e-6f;

struct VcmSettings {
    float radius = 0.0f;   ///< of the first iteration, over that of the scene's bounds; 0: kUsualRadius or a
                           ///< pixel's (pixel_radius.h), whichever is less, over the root of `samples`, so that an eye
                           ///< vertex merges with as many whatever their number
    float alpha = 0.75f;   ///< how fast it shrinks: r_i^2 = r_1^2 i^(alpha - 1); 1: not at all
    bool first = true;     ///< eye subpaths merge at their first vertex
    uint32_t samples = 1;  ///< of every pixel that share their light vertices

    bool open_radius() const { return radius == 0.0f; }
    /// `pixel`: radius of a pixel; both over that of the scene's bounds.
    float first_radius(float pixel) const;

    /// Throws Error(usage) for a radius below kLeastRadius.
    static VcmSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
