// Terms that the principled BSDFs share (Burley 2012, "Physically Based Shading at Disney"; Burley 2015, "Extending the
// Disney BRDF to a BSDF with Integrated Subsurface Scattering"), as Mitsuba 3 has them.
#pragma once

#include "transport/bsdf/microfacet.h"

namespace ambilux {

/// Schlick's (1 - cos)^5.
AMBILUX_HD float schlick_weight(float cosine) {
    const float m = clamp(1.0f - cosine, 0.0f, 1.0f), m2 = m * m;
    return m2 * m2 * m;
}

/// A colour divided by its luminance.
AMBILUX_HD Rgb burley_tint(Rgb color) {
    const float l = luminance(color);
    return l > 0.0f ? color / l : splat(1.0f);
}

/// Root of roughness along t over that along s.
AMBILUX_HD float burley_aspect(float anisotropic) { return sqrtf(1.0f - 0.9f * clamp(anisotropic, 0.0f, 1.0f)); }

AMBILUX_HD MicrofacetDistribution burley_microfacets(float roughness, float anisotropic) {
    const float alpha = roughness * roughness, aspect = burley_aspect(anisotropic);
    return {Microfacets::ggx, max(alpha / aspect, 1e-3f), max(alpha * aspect, 1e-3f)};
}

/// Reflectance of a dielectric that takes the hue of `color`; `w`: Schlick's weight of the half vector.
AMBILUX_HD Rgb burley_tinted_fresnel(Rgb color, float ior, float w) {
    const Rgb f0 = burley_tint(color) * sqr((ior - 1.0f) / (ior + 1.0f));
    return f0 + (splat(1.0f) - f0) * w;
}

/// Diffuse lobe with retroreflection, its subsurface form and sheen; `cosine`: of either direction with the half
/// vector. Without the cosine of the direction that light leaves in. `p` has the members of Principled of these names.
template <class Parameters>
AMBILUX_HD Rgb burley_diffuse(const Parameters& p, float cos_i, float cos_o, float cosine) {
    const float fi = schlick_weight(cos_i), fo = schlick_weight(cos_o);
    const float rr = 2.0f * p.roughness * cosine * cosine;
    float shape = (1.0f - 0.5f * fi) * (1.0f - 0.5f * fo) + rr * (fo + fi + fo * fi * (rr - 1.0f));
    if (p.flatness > 0) {
        const float f90 = 0.5f * rr, fss = lerp(1.0f, f90, fo) * lerp(1.0f, f90, fi);
        const float subsurface = 1.25f * (fss * (1.0f / (cos_o + cos_i) - 0.5f) + 0.5f);
        shape = lerp(shape, subsurface, float(p.flatness) / 65535.0f);
    }
    Rgb value = p.base_color * (shape * kInvPi);
    if (p.sheen > 0.0f) {
        const float share = float(p.sheen_tint) / 65535.0f;
        const Rgb color = splat(1.0f - share) + burley_tint(p.base_color) * share;
        value += color * (p.sheen * schlick_weight(cosine));
    }
    return value;
}

}  // namespace ambilux
