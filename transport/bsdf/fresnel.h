// Fresnel equations for unpolarised light, and the directions of reflection and refraction.
#pragma once

#include "core/math.h"

namespace ambilux {

/// Boundary seen along one direction.
struct FresnelDielectric {
    float reflectance;
    float cos_t;   ///< cosine of the refracted direction, opposite in sign to cos_i; 0 on total reflection
    float eta_it;  ///< index of the far side over that of the side of the direction
};

/// Reflectance at cosine `cos_i` of a boundary of relative index `ior` (interior over exterior); cos_i < 0 is inside.
/// Born and Wolf 1999, section 1.5.2. Within 12 roundings of the reflectance at a cosine and index off by 8.
AMBILUX_HD FresnelDielectric fresnel_dielectric(float cos_i, float ior) {
    const float eta = cos_i >= 0.0f ? ior : 1.0f / ior;
    const float ci = fabsf(cos_i);
    // 1 - sin²/eta² in a form that is exact for eta = 1.
    const float cos2_t = (ci * ci + (eta - 1.0f) * (eta + 1.0f)) / (eta * eta);
    const float ct = safe_sqrt(cos2_t);
    if (eta == 1.0f) return {0.0f, -cos_i, 1.0f};
    if (!(ct > 0.0f) || ci == 0.0f) return {1.0f, cos_i >= 0.0f ? -ct : ct, eta};
    const float s = (ci - eta * ct) / (ci + eta * ct), p = (eta * ci - ct) / (eta * ci + ct);
    return {min(0.5f * (s * s + p * p), 1.0f), cos_i >= 0.0f ? -ct : ct, eta};
}

/// Reflectance of a conductor of relative index eta - i·k at cosine `cos_i` >= 0 (exact; PBRT 3rd ed., 8.2.1).
/// Absolute error 4e-6 for k >= 0.5, 4e-4 below.
AMBILUX_HD float fresnel_conductor(float cos_i, float eta, float k) {
    const float cos2 = cos_i * cos_i, sin2 = max(1.0f - cos2, 0.0f);
    const float t = eta * eta - k * k - sin2;
    const float a2b2 = safe_sqrt(t * t + 4.0f * eta * eta * k * k), a = safe_sqrt(0.5f * (a2b2 + t));
    const float s0 = a2b2 + cos2, s1 = 2.0f * cos_i * a;
    // All terms vanish together only where nothing is reflected differently from the outside: eta = 1, grazing.
    if (!(s0 + s1 > 0.0f)) return 1.0f;
    const float rs = (s0 - s1) / (s0 + s1);
    const float p0 = a2b2 * cos2 + sin2 * sin2, p1 = s1 * sin2;
    const float rp = p0 + p1 > 0.0f ? rs * (p0 - p1) / (p0 + p1) : rs;
    return clamp(0.5f * (rs + rp), 0.0f, 1.0f);
}

AMBILUX_HD Rgb fresnel_conductor(float cos_i, Rgb eta, Rgb k) {
    return {fresnel_conductor(cos_i, eta.x, k.x), fresnel_conductor(cos_i, eta.y, k.y),
            fresnel_conductor(cos_i, eta.z, k.z)};
}

AMBILUX_HD Vec3f reflect(Vec3f wi) { return {-wi.x, -wi.y, wi.z}; }
AMBILUX_HD Vec3f reflect(Vec3f wi, Vec3f m) { return m * (2.0f * dot(wi, m)) - wi; }

/// Direction behind a boundary with normal +z; `f` as seen along wi.
AMBILUX_HD Vec3f refract(Vec3f wi, const FresnelDielectric& f) {
    const float inv = 1.0f / f.eta_it;
    return {-wi.x * inv, -wi.y * inv, f.cos_t};
}
/// Direction behind a boundary with unit normal m on either side; `f` was evaluated at dot(wi, m).
AMBILUX_HD Vec3f refract(Vec3f wi, Vec3f m, const FresnelDielectric& f) {
    const float inv = 1.0f / f.eta_it;
    return normalize(m * (dot(wi, m) * inv + f.cos_t) - wi * inv);
}

}  // namespace ambilux
