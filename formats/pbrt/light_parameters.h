// What lights of pbrt share.
#pragma once

#include <cmath>

#include "formats/pbrt/scene.h"

namespace ambilux::pbrt {

struct Emission {
    Rgb color;
    double scale;  ///< of the parameter and the film

    Rgb scaled(double factor = 1) const { return color * float(scale * factor); }
};

inline Emission emission(SceneMaker& scene, const Described& light, const char* name) {
    const Parameter* p = light.in.find(name);
    const double scale = light.in.number("scale", 1);
    if (!(scale >= 0)) fail(light.in.where_of("scale"), "the scale of a light must not be negative");
    return {p ? scene.spectra().color(*p, ColorUse::light, light.space) : splat(1), scale * scene.exposure};
}

/// Factor that gives the light the power of its parameter, over that of a light of 1.
inline double power_factor(const Described& light, const char* name, double of_one) {
    const double value = light.in.number(name, -1);
    return value > 0 ? value / of_one : 1;
}

/// Rotation of the world's transform; a uniform scale is nothing to what is infinitely far away.
inline Matrix rotation_of(const Matrix& m) { return document::without_place(document::unscaled(m)); }

/// Lights with an image: from a point through a frustum, and in all directions.
void add_projection(SceneMaker& scene, const Described& light);
void add_goniometric(SceneMaker& scene, const Described& light);

}  // namespace ambilux::pbrt
