// Settings of integrator vcm.
#pragma once

#include <cstdint>

namespace ambilux {

struct RenderSettings;

/// That of the papers.
constexpr float kUsualRadius = 0.003f;
/// Floats tell places in a scene apart down to some 1e-7 of its radius.
constexpr float kLeastRadius = 1e-6f;

/// What `merge_radius` is measured in.
enum class RadiusUnit : uint32_t {
    scene,      ///< radii of the scene's bounds
    world,      ///< the scene's own units
    pixel,      ///< radii of a pixel at the median of what is seen (pixel_radius.h)
    footprint,  ///< radii of a pixel where the eye subpath has its first vertex
};
/// Of footprints to their median: farther away the radius does not grow.
constexpr float kLargestFootprint = 2.0f;

struct VcmSettings {
    float radius = 0.0f;  ///< of the first iteration, in `unit`; 0: kUsualRadius of the scene or a pixel's, whichever
                          ///< is less, over the root of `samples`, so that an eye vertex merges with as many whatever
                          ///< their number
    RadiusUnit unit = RadiusUnit::scene;
    float alpha = 0.75f;   ///< how fast it shrinks: r_i^2 = r_1^2 i^(alpha - 1); 1: not at all
    bool first = true;     ///< eye subpaths merge at their first vertex
    uint32_t samples = 1;  ///< of every pixel that share their light vertices

    bool open_radius() const { return radius == 0.0f; }
    bool asks_pixels() const { return open_radius() || unit >= RadiusUnit::pixel; }
    /// The largest, in the scene's units, of its bounds and of a pixel; at least kLeastRadius of the bounds.
    float first_radius(float scene, float pixel) const;

    /// Throws Error(usage) for a radius below kLeastRadius of the scene, or above its own.
    static VcmSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
