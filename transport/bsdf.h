// The BSDF interface: a value type with resolved parameters, evaluated in the local shading frame.
//
// Conventions (Mitsuba's, Veach 1997 chapter 5 for the two modes):
// - wi points to where the walk came from, wo to where it goes; both point away from the surface, unit, local frame, z
// = shading normal.
// - eval returns f(wi,wo)·|cos(wo)|, without delta lobes. sample returns eval/pdf as `weight`; for delta lobes the
// ratio in the limit.
// - TransportMode::radiance: walk from the camera; importance: walk from a light. They differ by eta² on refraction
// only; the factor for
//   shading normals is applied outside, once around all BSDFs (transport/surface_scattering.h).
// - pdf_sa is the density of wo per solid angle that sample uses; it is the same in both modes up to the swap of roles.
// - sample takes u.x for the choice of a lobe and (u.y, u.z) for the direction, uniform in [0,1); false means that the
// walk ends.
//
// A new BSDF is one file in transport/bsdf/ with eval, pdf and sample, a BsdfType, and a case in make_bsdf and
// with_bsdf.
#pragma once

#include <bit>

#include "scene/view.h"
#include "transport/bsdf/conductor.h"
#include "transport/bsdf/dielectric.h"
#include "transport/bsdf/diffuse.h"
#include "transport/bsdf/plastic.h"
#include "transport/bsdf/rough_conductor.h"
#include "transport/bsdf/rough_dielectric.h"
#include "transport/bsdf/rough_diffuse.h"
#include "transport/bsdf/rough_plastic.h"
#include "transport/bsdf/sample.h"
#include "transport/bsdf/thin_dielectric.h"
#include "transport/texture.h"

namespace ambilux {

/// Parameters of a BsdfRecord at one surface point, textures looked up. Types share fields; each sets and reads its own
/// only.
struct Bsdf {
    BsdfType type;
    Microfacets microfacets;
    bool sample_visible, nonlinear;
    Rgb reflectance_or_eta;  ///< diffuse and plastics: diffuse reflectance; conductors: eta
    Rgb specular_reflectance;
    Rgb transmittance_or_k;  ///< dielectrics: specular transmittance; conductors: k
    float ior;
    float alpha_u, alpha_v;
    float fdr_internal, specular_sampling_weight;
    const float* transmittance_table;
};

/// True if light can pass to the other side.
AMBILUX_HD bool bsdf_transmits(BsdfType type) {
    return type == BsdfType::dielectric || type == BsdfType::thin_dielectric || type == BsdfType::rough_dielectric;
}

/// Parameters that textures may set. What else a Bsdf has is the same at all points of its record.
struct BsdfParameters {
    Rgb color;  ///< reflectance; of dielectrics specular transmittance
    float alpha_u;
    Rgb specular_reflectance;
    float alpha_v;
};

/// Looks up the parameters at texture coordinates `uv`.
template <Features F>
struct ParametersAt {
    const SceneView& scene;
    Vec2f uv;

    AMBILUX_HD Rgb rgb(Rgb BsdfParameters::*, const ParamRgb& input) const { return eval_rgb<F>(scene, input, uv); }
    AMBILUX_HD float number(float BsdfParameters::*, const ParamFloat& input) const {
        return eval_float<F>(scene, input, uv);
    }
};

/// Has them.
struct KnownParameters {
    const BsdfParameters& known;

    AMBILUX_HD Rgb rgb(Rgb BsdfParameters::* which, const ParamRgb&) const { return known.*which; }
    AMBILUX_HD float number(float BsdfParameters::* which, const ParamFloat&) const { return known.*which; }
};

/// The BSDF of `record` with parameters by `of`, one of the above. Microfacet roughness is at least kMinAlpha.
template <Features F, class Parameters>
AMBILUX_HD Bsdf make_bsdf(const SceneView& scene, const BsdfRecord& record, const Parameters& of) {
    Bsdf b = {};
    b.type = F.several_bsdfs() ? record.type : BsdfType(std::countr_zero(F.bsdfs));
    const auto specular_reflectance = [&] {
        b.specular_reflectance = of.rgb(&BsdfParameters::specular_reflectance, record.specular_reflectance);
    };
    const auto reflectance = [&] { b.reflectance_or_eta = of.rgb(&BsdfParameters::color, record.reflectance); };
    const auto conductor = [&] {
        specular_reflectance();
        b.reflectance_or_eta = record.eta;
        b.transmittance_or_k = record.k;
    };
    const auto dielectric = [&] {
        specular_reflectance();
        b.transmittance_or_k = of.rgb(&BsdfParameters::color, record.specular_transmittance);
        b.ior = record.ior;
    };
    const auto plastic = [&] {
        specular_reflectance();
        reflectance();
        b.ior = record.ior;
        b.nonlinear = record.nonlinear != 0;
        b.fdr_internal = record.fdr_internal;
        b.specular_sampling_weight = record.specular_sampling_weight;
    };
    const auto microfacets = [&] {
        b.microfacets = record.microfacets;
        b.sample_visible = record.sample_visible != 0;
        b.alpha_u = max(of.number(&BsdfParameters::alpha_u, record.alpha_u), kMinAlpha);
        b.alpha_v = max(of.number(&BsdfParameters::alpha_v, record.alpha_v), kMinAlpha);
    };
    switch (b.type) {
        case BsdfType::diffuse:
            if constexpr (F.has(BsdfType::diffuse)) reflectance();
            break;
        case BsdfType::rough_diffuse:
            if constexpr (F.has(BsdfType::rough_diffuse)) {
                reflectance();
                b.alpha_u = of.number(&BsdfParameters::alpha_u, record.alpha_u);
            }
            break;
        case BsdfType::conductor:
            if constexpr (F.has(BsdfType::conductor)) conductor();
            break;
        case BsdfType::rough_conductor:
            if constexpr (F.has(BsdfType::rough_conductor)) {
                conductor();
                microfacets();
            }
            break;
        case BsdfType::dielectric:
            if constexpr (F.has(BsdfType::dielectric)) dielectric();
            break;
        case BsdfType::thin_dielectric:
            if constexpr (F.has(BsdfType::thin_dielectric)) dielectric();
            break;
        case BsdfType::rough_dielectric:
            if constexpr (F.has(BsdfType::rough_dielectric)) {
                dielectric();
                microfacets();
            }
            break;
        case BsdfType::plastic:
            if constexpr (F.has(BsdfType::plastic)) plastic();
            break;
        case BsdfType::rough_plastic:
            if constexpr (F.has(BsdfType::rough_plastic)) {
                plastic();
                microfacets();
                b.transmittance_table = scene.tables + record.transmittance_table;
            }
            break;
        case BsdfType::count: break;
    }
    return b;
}

/// Those with which `b` was made.
AMBILUX_HD BsdfParameters parameters_of(const Bsdf& b) {
    return {bsdf_transmits(b.type) ? b.transmittance_or_k : b.reflectance_or_eta, b.alpha_u, b.specular_reflectance,
            b.alpha_v};
}

/// The BSDF of `record` at texture coordinates `uv`.
template <Features F>
AMBILUX_HD Bsdf resolve_bsdf(const SceneView& scene, const BsdfRecord& record, Vec2f uv) {
    return make_bsdf<F>(scene, record, ParametersAt<F>{scene, uv});
}

/// Calls `op` with the BSDF that `b` stands for; `otherwise` when kernels of features F do not know it.
template <Features F, typename Result, typename Op>
AMBILUX_HD Result with_bsdf(const Bsdf& b, Result otherwise, Op op) {
    const MicrofacetDistribution microfacets = {b.microfacets, b.alpha_u, b.alpha_v};
    switch (b.type) {
        case BsdfType::diffuse:
            if constexpr (F.has(BsdfType::diffuse)) return op(Diffuse{b.reflectance_or_eta});
            break;
        case BsdfType::rough_diffuse:
            if constexpr (F.has(BsdfType::rough_diffuse)) return op(RoughDiffuse{b.reflectance_or_eta, b.alpha_u});
            break;
        case BsdfType::conductor:
            if constexpr (F.has(BsdfType::conductor))
                return op(Conductor{b.specular_reflectance, b.reflectance_or_eta, b.transmittance_or_k});
            break;
        case BsdfType::rough_conductor:
            if constexpr (F.has(BsdfType::rough_conductor))
                return op(RoughConductor{b.specular_reflectance, b.reflectance_or_eta, b.transmittance_or_k,
                                         microfacets, b.sample_visible});
            break;
        case BsdfType::dielectric:
            if constexpr (F.has(BsdfType::dielectric))
                return op(Dielectric{b.specular_reflectance, b.transmittance_or_k, b.ior});
            break;
        case BsdfType::thin_dielectric:
            if constexpr (F.has(BsdfType::thin_dielectric))
                return op(ThinDielectric{b.specular_reflectance, b.transmittance_or_k, b.ior});
            break;
        case BsdfType::rough_dielectric:
            if constexpr (F.has(BsdfType::rough_dielectric))
                return op(RoughDielectric{b.specular_reflectance, b.transmittance_or_k, b.ior, microfacets,
                                          b.sample_visible});
            break;
        case BsdfType::plastic:
            if constexpr (F.has(BsdfType::plastic))
                return op(Plastic{b.reflectance_or_eta, b.specular_reflectance, b.ior, b.fdr_internal,
                                  b.specular_sampling_weight, b.nonlinear});
            break;
        case BsdfType::rough_plastic:
            if constexpr (F.has(BsdfType::rough_plastic))
                return op(RoughPlastic{b.reflectance_or_eta, b.specular_reflectance, b.ior, b.fdr_internal,
                                       b.specular_sampling_weight, b.nonlinear, microfacets, b.sample_visible,
                                       b.transmittance_table});
            break;
        case BsdfType::count: break;
    }
    return otherwise;
}

namespace detail {

template <Features F>
AMBILUX_HD_APART BsdfValue bsdf_evaluate_apart(Bsdf b, Vec3f wi, Vec3f wo, TransportMode mode) {
    return with_bsdf<F>(b, no_scattering(), [&](const auto& bsdf) -> BsdfValue {
        if constexpr (requires { bsdf.evaluate(wi, wo, mode); })
            return bsdf.evaluate(wi, wo, mode);
        else if constexpr (requires { bsdf.evaluate(wi, wo); })
            return bsdf.evaluate(wi, wo);
        else
            return no_scattering();  // delta lobes only
    });
}

struct SampleOrNone {
    BsdfSample sample;
    bool some;
};

template <Features F>
AMBILUX_HD_APART SampleOrNone bsdf_sample_apart(Bsdf b, Vec3f wi, Vec3f u, TransportMode mode) {
    SampleOrNone s;
    s.some = with_bsdf<F>(b, false, [&](const auto& bsdf) { return bsdf.sample(wi, u, mode, s.sample); });
    return s;
}

}  // namespace detail

/// f(wi,wo)·|cos(wo)| of the smooth lobes, and the densities of both directions per solid angle over them, the chance
/// of choosing them included; 0 where sides do not fit.
template <Features F>
AMBILUX_HD BsdfValue bsdf_evaluate(const Bsdf& b, Vec3f wi, Vec3f wo, TransportMode mode) {
    if constexpr (F.bsdfs == bit(BsdfType::diffuse)) {
        return Diffuse{b.reflectance_or_eta}.evaluate(wi, wo);
    } else {
        return detail::bsdf_evaluate_apart<F>(b, wi, wo, mode);
    }
}

template <Features F>
AMBILUX_HD Rgb bsdf_eval(const Bsdf& b, Vec3f wi, Vec3f wo, TransportMode mode) {
    return bsdf_evaluate<F>(b, wi, wo, mode).value;
}

template <Features F>
AMBILUX_HD float bsdf_pdf(const Bsdf& b, Vec3f wi, Vec3f wo, TransportMode mode) {
    return bsdf_evaluate<F>(b, wi, wo, mode).pdf_sa;
}

/// Draws wo from uniform u in [0,1)³ (x: lobe). False when nothing is scattered; `out` is then unspecified.
template <Features F>
AMBILUX_HD bool bsdf_sample(const Bsdf& b, Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) {
    if constexpr (F.bsdfs == bit(BsdfType::diffuse)) {
        return Diffuse{b.reflectance_or_eta}.sample(wi, u, mode, out);
    } else {
        const detail::SampleOrNone s = detail::bsdf_sample_apart<F>(b, wi, u, mode);
        if (s.some) out = s.sample;
        return s.some;
    }
}

/// True if there is a lobe that is not a delta, so that connecting to other vertices can give light.
AMBILUX_HD bool bsdf_is_smooth(const Bsdf& b) {
    return b.type != BsdfType::conductor && b.type != BsdfType::dielectric && b.type != BsdfType::thin_dielectric;
}

}  // namespace ambilux
