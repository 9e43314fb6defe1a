// Renders by integrators that merge: settings, means over independent renders, and a scene that has the same radiance
// everywhere.
#pragma once

#include <cmath>

#include "tests/support/whole_iterations.h"

namespace ambilux {

inline RenderSettings vcm_settings(const Scene& scene, const char* radius = "0.01", const char* integrator = "vcm",
                                   const char* variant = "wavefront") {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = integrator;
    s.variant = variant;
    apply_setting(s, "merge_radius", radius);
    return s;
}

/// Over independent renders.
struct Mean {
    double value, error;
};
inline Mean mean_over_seeds(const Scene& scene, RenderSettings s, uint32_t samples, uint32_t seeds) {
    double sum = 0, squares = 0;
    for (uint32_t k = 0; k < seeds; ++k) {
        s.seed = 100 + k;
        const double m = mean_of(render_scene(scene, s, samples).film);
        sum += m, squares += m * m;
    }
    const double mean = sum / seeds;
    return {mean, std::sqrt(std::max(squares / seeds - mean * mean, 0.0) / (seeds - 1))};
}

/// The camera is in a glowing sphere that reflects a half: radiance 2 everywhere.
inline Scene glowing_sphere() {
    return scene_from_text(
        "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><float name='fov' value='60'/>"
        "<transform name='to_world'><lookat origin='0.2,0.1,0' target='1,0,0' up='0,1,0'/></transform><film "
        "type='hdrfilm'><integer name='width' value='16'/><integer name='height' value='16'/></film></sensor>"
        "<shape type='sphere'><boolean name='flip_normals' value='true'/><bsdf type='diffuse'><rgb name='reflectance' "
        "value='0.5'/></bsdf><emitter type='area'><rgb name='radiance' value='1'/></emitter></shape></scene>");
}

/// The sphere bends away from a disk of a tenth of its radius: at most r^2 / 4 of the light.
inline void check_glow(const Mean& m) {
    CHECK(std::fabs(m.value - 2.0) < 4.0 * m.error + 0.005);
    CHECK(m.error < 0.02);
}

}  // namespace ambilux
