// Microfacet distributions: Beckmann, GGX and Phong, anisotropic (Walter et al. 2007; Heitz 2014, "Understanding the
// Masking-Shadowing Function in Microfacet-Based BRDFs"). Local frame, z = normal of the macrosurface.
#pragma once

#include "core/sampling.h"
#include "models/bsdf/model.h"

namespace ambilux {

/// Smallest roughness, as in Mitsuba: below it float half vectors do not resolve the lobe.
constexpr float kMinAlpha = 1e-4f;

/// Inverse error function (Giles 2010, "Approximating the erfinv function", single precision; in double precision
/// followed by two Newton steps).
AMBILUX_HD float inverse_erf(float x) {
    x = clamp(x, -kOneMinusEpsilon, kOneMinusEpsilon);
    float w = -logf((1.0f - x) * (1.0f + x)), p;
    if (w < 5.0f) {
        w -= 2.5f;
        p = 2.81022636e-08f;
        p = 3.43273939e-07f + p * w;
        p = -3.5233877e-06f + p * w;
        p = -4.39150654e-06f + p * w;
        p = 0.00021858087f + p * w;
        p = -0.00125372503f + p * w;
        p = -0.00417768164f + p * w;
        p = 0.246640727f + p * w;
        p = 1.50140941f + p * w;
    } else {
        w = sqrtf(w) - 3.0f;
        p = -0.000200214257f;
        p = 0.000100950558f + p * w;
        p = 0.00134934322f + p * w;
        p = -0.00367342844f + p * w;
        p = 0.00573950773f + p * w;
        p = -0.0076224613f + p * w;
        p = 0.00943887047f + p * w;
        p = 1.00167406f + p * w;
        p = 2.83297682f + p * w;
    }
    float y = p * x;
    if constexpr (!kSinglePrecision)
        for (int i = 0; i < 2; ++i) y -= (erff(y) - x) * expf(y * y) * 0.88622692545275801f;  // sqrt(pi)/2
    return y;
}

/// Microfacet normal that reflects unit wi to unit wo, both above the horizon, and its cosine with either, the same
/// however they are exchanged; not above 0 if they are opposite.
AMBILUX_HD Vec3f half_vector(Vec3f wi, Vec3f wo, float& cosine) {
    const Vec3f h = wi + wo;
    const float l2 = length_squared(h), inv = inverse_sqrt(l2);
    cosine = 0.5f * l2 * inv;
    return h * inv;
}

/// MicrofacetDistribution::reflection.
struct MicrofacetReflection {
    float value, pdf_sa, pdf_reverse_sa;
};

/// Beckmann's or GGX.
struct MicrofacetDistribution {
    Microfacets type;
    float alpha_u, alpha_v;

    /// That of a BSDF, with at least kMinAlpha.
    AMBILUX_HD static MicrofacetDistribution of(Microfacets type, float alpha_u, float alpha_v) {
        return {type, max(alpha_u, kMinAlpha), max(alpha_v, kMinAlpha)};
    }
    AMBILUX_HD MicrofacetDistribution widened(float scale) const { return {type, alpha_u * scale, alpha_v * scale}; }

    /// Density D(m) of microfacet area per macrosurface area and solid angle; 0 below the horizon. Relative error of 14
    /// roundings, Beckmann's 6 times its exponent more; of m there are 3 roundings over the roughness besides.
    AMBILUX_HD float d(Vec3f m) const {
        if (!(m.z > 0.0f)) return 0.0f;
        const float norm = 1.0f / (kPi * alpha_u * alpha_v);
        const float r2 = sqr(m.x / alpha_u) + sqr(m.y / alpha_v), z2 = m.z * m.z;
        if (type == Microfacets::ggx) return norm / sqr(r2 + z2);
        const float e = expf(-r2 / z2);
        return e > 0.0f ? norm * e / (z2 * z2) : 0.0f;
    }

    /// Projected area of the microfacets that face `v`, per macrosurface area: cos·(1+Λ), v.z >= 0, so that Smith's
    /// G1 = cos/sigma. Finite and positive down to the horizon (Heitz 2014, section 5.3; Heitz 2018, eq. 2). Relative
    /// error of 14 roundings.
    AMBILUX_HD float sigma(Vec3f v) const {
        const float t2 = sqr(v.x * alpha_u) + sqr(v.y * alpha_v);
        if (type == Microfacets::ggx) return 0.5f * (v.z + sqrtf(v.z * v.z + t2));
        const float t = sqrtf(t2);
        if (!(t > 0.0f)) return v.z;
        const float a = v.z / t;
        return 0.5f * (v.z * (1.0f + erff(a)) + t * expf(-a * a) * 0.56418958354775628f);
    }

    /// Reflection at m = half_vector(wi, wo, cosine): D·G1(wi)·G1(wo)/(4·cos(wi)), which is f·cos(wo) without
    /// Fresnel (Walter et al. 2007, equation 20), and the densities of wo and of wi by sample() at the other: that of
    /// m, visible D·(w·m)/sigma(w) or all of them D·cos(m), over 4·(w·m).
    AMBILUX_HD MicrofacetReflection reflection(Vec3f wi, Vec3f wo, Vec3f m, float cosine, bool visible) const {
        const float density = d(m) * 0.25f, sigma_i = sigma(wi), sigma_o = sigma(wo);
        const float per_i = density / sigma_i;  // G1 = cos/sigma
        const float value = per_i * min(wo.z / sigma_o, 1.0f);
        if (visible) return {value, per_i, density / sigma_o};
        const float all = density * m.z / cosine;
        return {value, all, all};
    }

    /// Microfacet normal, visible from wi (wi.z > 0) or from the whole distribution in proportion to D·cos.
    AMBILUX_HD Vec3f sample(Vec3f wi, Vec2f u, bool visible) const { return sample_apart(*this, wi, u, visible); }
    AMBILUX_HD_APART static Vec3f sample_apart(MicrofacetDistribution of, Vec3f wi, Vec2f u, bool visible) {
        if (!visible) return of.sample_all(u);
        return of.type == Microfacets::ggx ? of.sample_visible_ggx(wi, u) : of.sample_visible_beckmann(wi, u);
    }

    /// Walter et al. 2007, equations 28 and 35, on slopes so that anisotropy is a stretch.
    AMBILUX_HD Vec3f sample_all(Vec2f u) const {
        const float tan2 = type == Microfacets::ggx ? u.x / (1.0f - u.x) : -logf(1.0f - u.x);
        const float r = sqrtf(tan2);
        float sine, cosine;
        sin_cos_turns(u.y, sine, cosine);
        return normalize({alpha_u * r * cosine, alpha_v * r * sine, 1.0f});
    }

    /// Spherical caps (Dupuy and Benyoub 2023, "Sampling Visible GGX Normals with Spherical Caps", listing 3).
    AMBILUX_HD Vec3f sample_visible_ggx(Vec3f wi, Vec2f u) const {
        const Vec3f v = normalize({wi.x * alpha_u, wi.y * alpha_v, wi.z});
        const float z = (1.0f - u.y) * (1.0f + v.z) - v.z, r = safe_sqrt(1.0f - z * z);
        float sine, cosine;
        sin_cos_turns(u.x, sine, cosine);
        const Vec3f h = Vec3f{r * cosine, r * sine, z} + v;
        const Vec3f m = {h.x * alpha_u, h.y * alpha_v, max(h.z, 0.0f)};
        const float l2 = length_squared(m);
        return l2 > 0.0f ? m * inverse_sqrt(l2) : Vec3f{0.0f, 0.0f, 1.0f};
    }

    /// Visible slopes (Heitz and d'Eon 2014, "Importance Sampling Microfacet-Based BSDFs using the Distribution of
    /// Visible Normals", supplemental 1): the slope towards v by inverting its cumulative density, the other one is
    /// Gaussian.
    AMBILUX_HD Vec3f sample_visible_beckmann(Vec3f wi, Vec2f u) const {
        const Vec3f v = normalize({wi.x * alpha_u, wi.y * alpha_v, wi.z});
        const float sin_v = sqrtf(v.x * v.x + v.y * v.y);
        const float cos_phi = sin_v > 0.0f ? v.x / sin_v : 1.0f, sin_phi = sin_v > 0.0f ? v.y / sin_v : 0.0f;
        const float x = visible_beckmann_slope(v.z, sin_v, u.x), y = inverse_erf(2.0f * u.y - 1.0f);
        return normalize({-alpha_u * (cos_phi * x - sin_phi * y), -alpha_v * (sin_phi * x + cos_phi * y), 1.0f});
    }

    /// Slope x with density (cos - x·sin)·exp(-x²)/√π, x <= cos/sin, at cumulative share u. Solved for b = erf(x), in
    /// which the cumulative density [cos·(1+b) + sin·exp(-x²)/√π]/2 is close to linear: Newton steps inside a shrinking
    /// bracket.
    AMBILUX_HD static float visible_beckmann_slope(float cosine, float sine, float u) {
        constexpr float kTolerance = kSinglePrecision ? 1e-7f : 1e-14f;
        const float inv_sqrt_pi = 0.56418958354775628f;
        float lo = -1.0f, hi = sine > 0.0f ? erff(cosine / sine) : 1.0f;
        const float top = sine > 0.0f ? expf(-sqr(cosine / sine)) : 0.0f;
        const float total = cosine * (1.0f + hi) + sine * inv_sqrt_pi * top;
        float b = lo + (hi - lo) * u, x = 0.0f;
        for (int i = 0; i < 12; ++i) {
            x = inverse_erf(b);
            const float error = cosine * (1.0f + b) + sine * inv_sqrt_pi * expf(-x * x) - u * total;
            if (fabsf(error) < kTolerance * total) break;
            (error > 0.0f ? hi : lo) = b;
            const float next = b - error / (cosine - sine * x);
            b = next > lo && next < hi ? next : 0.5f * (lo + hi);
        }
        return x;
    }
};

/// Phong's: a power of the cosine, with an exponent of 2/alpha² - 2 along each axis, by which its peak is Beckmann's,
/// or 0 for an alpha above 1 (Ashikhmin and Shirley 2000; Walter et al. 2007, equations 30 to 32). It has the members
/// of MicrofacetDistribution. Of the older Mitsuba; apart from it, since few scenes have any.
struct PhongFacets {
    float alpha_u, alpha_v;

    AMBILUX_HD static PhongFacets of(Microfacets, float alpha_u, float alpha_v) {
        return {max(alpha_u, kMinAlpha), max(alpha_v, kMinAlpha)};
    }
    AMBILUX_HD PhongFacets widened(float scale) const { return {alpha_u * scale, alpha_v * scale}; }

    /// Of the cosine by its logarithm, which loses no digits where large exponents meet cosines near 1.
    AMBILUX_HD float d(Vec3f m) const {
        if (!(m.z > 0.0f)) return 0.0f;
        const float u = min(alpha_u, 1.0f), v = min(alpha_v, 1.0f);
        const float x2 = m.x * m.x, y2 = m.y * m.y, sin2 = x2 + y2, cos2 = max(m.z * m.z, 1e-30f);
        const float exponent = x2 * (1.0f / (u * u) - 1.0f) + y2 * (1.0f / (v * v) - 1.0f);  // its half times sin²
        const float log_cos = sin2 > 1e-30f ? log1pf(sin2 / cos2) / sin2 : 1.0f;             // the double over sin²
        return expf(-exponent * log_cos) / (kPi * u * v);
    }

    /// Smith's term of Beckmann's distribution of equal alpha by a rational function (Walter et al. 2007, equation 27
    /// and the text below it), as Mitsuba 0.6 has it.
    AMBILUX_HD float sigma(Vec3f v) const {
        const float t = sqrtf(sqr(v.x * alpha_u) + sqr(v.y * alpha_v));
        if (!(v.z < 1.6f * t)) return v.z;
        const float a = v.z / t;
        return max(t * (1.0f + a * (2.276f + 2.577f * a)) / (3.535f + 2.181f * a), v.z);  // less by 6e-5 near 1.6
    }

    /// Sampled from all normals, whatever `visible` says.
    AMBILUX_HD MicrofacetReflection reflection(Vec3f wi, Vec3f wo, Vec3f m, float cosine, bool) const {
        const float density = d(m) * 0.25f, all = density * m.z / cosine;
        return {density / sigma(wi) * min(wo.z / sigma(wo), 1.0f), all, all};
    }

    /// An azimuth that is uniform up to a stretch, and of the cosine a power of a uniform number.
    AMBILUX_HD Vec3f sample(Vec3f, Vec2f u, bool) const { return sample_apart(*this, u); }
    AMBILUX_HD_APART static Vec3f sample_apart(PhongFacets of, Vec2f u) {
        const float au = min(of.alpha_u, 1.0f), av = min(of.alpha_v, 1.0f);
        float sine, cosine;
        sin_cos_turns(u.y, sine, cosine);
        const float x = au * cosine, y = av * sine, a2 = x * x + y * y;
        const float r = sqrtf(expm1f(-a2 * logf(1.0f - u.x)) / a2);
        return normalize({r * x, r * y, 1.0f});
    }
};

}  // namespace ambilux
