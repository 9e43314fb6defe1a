// A layer of clear or absorbing dielectric, smooth or rough, over another BSDF, seen from the front (Mitsuba 0.6's
// coating and roughcoating after Weidlich and Wilkie 2007, "Arbitrarily layered micro-facet surfaces"): its boundary
// reflects, and what it lets through meets the base in bent directions. Light that the boundary reflects back down is
// left out, as there.
#pragma once

#include "models/parameters.h"
#include "scene/view.h"
#include "transport/bsdf/fresnel.h"
#include "transport/bsdf/microfacet.h"
#include "transport/bsdf/sample.h"

namespace ambilux {

/// A coating as SceneView::tables has it: floats in this order, and of a rough one kTransmittanceTableSize
/// transmittances behind them.
struct Coat {
    static constexpr uint32_t kFloats = 12;

    const float32* at;

    AMBILUX_HD float ior() const { return at[0]; }    ///< interior over exterior
    AMBILUX_HD float alpha() const { return at[1]; }  ///< roughness; 0: smooth
    AMBILUX_HD Microfacets distribution() const { return at[2] > 0 ? Microfacets::ggx : Microfacets::beckmann; }
    AMBILUX_HD float weight() const { return at[3]; }                     ///< of the boundary in sampling
    AMBILUX_HD Rgb reflectance() const { return {at[4], at[5], at[6]}; }  ///< scales what the boundary reflects
    AMBILUX_HD Rgb absorption() const { return {at[7], at[8], at[9]}; }   ///< along its thickness
    AMBILUX_HD bool rough() const { return at[1] > 0; }

    AMBILUX_HD MicrofacetDistribution microfacets() const {
        return MicrofacetDistribution::of(distribution(), alpha(), alpha());
    }

    /// Share of light at a cosine > 0 that the boundary lets through.
    AMBILUX_HD float transmittance(float cosine) const {
        if (!rough()) return 1.0f - fresnel_dielectric(cosine, ior()).reflectance;
        const float x = min(cosine, 1.0f) * float(kTransmittanceTableSize - 1);
        const uint32_t i = x < float(kTransmittanceTableSize - 2) ? uint32_t(x) : kTransmittanceTableSize - 2;
        return lerp(at[kFloats + i], at[kFloats + i + 1], x - float(i));
    }
    /// Chance of sampling the boundary when it lets `passed` through.
    AMBILUX_HD float probability(float passed) const {
        const float s = (1.0f - passed) * weight(), d = passed * (1.0f - weight());
        return s + d > 0.0f ? s / (s + d) : 0.0f;
    }
    /// A direction on the outside as the base sees it; z = 0 if none enters.
    AMBILUX_HD Vec3f bent(Vec3f w) const {
        const float inv = 1.0f / ior();
        return {w.x * inv, w.y * inv, -fresnel_dielectric(w.z, ior()).cos_t};
    }
    /// The same of one that leaves the base.
    AMBILUX_HD Vec3f unbent(Vec3f w) const {
        return {w.x * ior(), w.y * ior(), -fresnel_dielectric(w.z, 1.0f / ior()).cos_t};
    }
    AMBILUX_HD Rgb absorbed(float cos_i, float cos_o) const {
        const Rgb a = absorption();
        if (is_zero(a)) return splat(1.0f);
        const float way = 1.0f / cos_i + 1.0f / cos_o;
        return {expf(-a.x * way), expf(-a.y * way), expf(-a.z * way)};
    }
};

/// bsdf_evaluate of a base under a coating; `base(wi, wo)` is that of the base.
template <class Base>
AMBILUX_HD BsdfValue coated_evaluate(const Coat& coat, Vec3f wi, Vec3f wo, Base base) {
    if (!(wi.z > 0.0f) || !(wo.z > 0.0f)) return no_scattering();
    const Vec3f in = coat.bent(wi), out = coat.bent(wo);
    const float ti = coat.transmittance(wi.z), to = coat.transmittance(wo.z);
    const float pi = coat.probability(ti), po = coat.probability(to);
    BsdfValue v = no_scattering();
    if (in.z > 0.0f && out.z > 0.0f) {
        v = base(in, out);
        // Solid angles of bent directions.
        const float shrink = 1.0f / sqr(coat.ior()), bend_o = shrink * wo.z / out.z, bend_i = shrink * wi.z / in.z;
        v.value *= coat.absorbed(in.z, out.z) * (ti * to * bend_o);
        v.pdf_sa *= (1.0f - pi) * bend_o;
        v.pdf_reverse_sa *= (1.0f - po) * bend_i;
    }
    if (!coat.rough()) return v;
    float cos_m;
    const Vec3f m = half_vector(wi, wo, cos_m);
    if (!(cos_m > 0.0f)) return v;
    const MicrofacetReflection r = coat.microfacets().reflection(wi, wo, m, cos_m, true);
    v.value += coat.reflectance() * (fresnel_dielectric(cos_m, coat.ior()).reflectance * r.value);
    v.pdf_sa += pi * r.pdf_sa;
    v.pdf_reverse_sa += po * r.pdf_reverse_sa;
    return v;
}

/// bsdf_sample of the same; `sample(wi, u, out)` is that of the base.
template <class Base, class Sample>
AMBILUX_HD bool coated_sample(const Coat& coat, Vec3f wi, Vec3f u, Base base, Sample sample, BsdfSample& s) {
    if (!(wi.z > 0.0f)) return false;
    const float passed = coat.transmittance(wi.z), p = coat.probability(passed);
    if (u.x < p) {
        if (!coat.rough()) {
            s = {reflect(wi), p, p, coat.reflectance() * ((1.0f - passed) / p), 1.0f, kScatterDelta};
            return true;
        }
        const Vec3f m = coat.microfacets().sample(wi, {u.y, u.z}, true);
        if (!(dot(wi, m) > 0.0f)) return false;
        const Vec3f wo = normalize(reflect(wi, m));
        return smooth_sample(wo, coated_evaluate(coat, wi, wo, base), 1.0f, 0, s);
    }
    const Vec3f in = coat.bent(wi);
    if (!(in.z > 0.0f)) return false;
    u.x = min((u.x - p) / (1.0f - p), kOneMinusEpsilon);
    if (!sample(in, u, s) || !(s.wo.z > 0.0f)) return false;
    const Vec3f out = s.wo, wo = coat.unbent(out);
    if (!(wo.z > 0.0f)) return false;  // reflected back down
    if (!(s.flags & kScatterDelta)) return smooth_sample(wo, coated_evaluate(coat, wi, wo, base), 1.0f, 0, s);
    s.wo = wo;
    s.pdf_sa *= 1.0f - p;
    s.pdf_reverse_sa *= 1.0f - p;
    s.weight *= coat.absorbed(in.z, out.z) * (passed * coat.transmittance(wo.z) / (1.0f - p));
    return true;
}

}  // namespace ambilux
