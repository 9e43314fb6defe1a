// The BSDF interface: a value type with resolved parameters, evaluated in the local shading frame.
//
// Conventions (Mitsuba's, Veach 1997 chapter 5 for the two modes):
// - wi points to where the subpath came from, wo to where it goes; both point away from the surface, unit, local frame,
// z = shading normal.
// - eval returns f(wi,wo)·|cos(wo)|, without delta lobes. sample returns eval/pdf as `weight`; for delta lobes the
// ratio in the limit.
// - TransportMode::radiance: subpath from the camera; importance: from a light. They differ by eta² on refraction
// only; the factor for
//   shading normals is applied outside, once around all BSDFs (transport/surface_scattering.h).
// - pdf_sa is the density of wo per solid angle that sample uses; it is the same in both modes up to the swap of roles.
// - sample takes u.x for the choice of a lobe and (u.y, u.z) for the direction, uniform in [0,1); false means that the
// subpath ends.
//
// A new BSDF is a model in models/bsdf/, its functions in transport/bsdf/, and a line in models/bsdf_list.h.
#pragma once

#include "transport/bsdf/coating.h"
#include "transport/bsdf/conductor.h"
#include "transport/bsdf/dielectric.h"
#include "transport/bsdf/diffuse.h"
#include "transport/bsdf/diffuse_transmitter.h"
#include "transport/bsdf/phong.h"
#include "transport/bsdf/plastic.h"
#include "transport/bsdf/principled.h"
#include "transport/bsdf/principled_thin.h"
#include "transport/bsdf/rough_conductor.h"
#include "transport/bsdf/rough_dielectric.h"
#include "transport/bsdf/rough_diffuse.h"
#include "transport/bsdf/rough_plastic.h"
#include "transport/bsdf/sample.h"
#include "transport/bsdf/thin_dielectric.h"
#include "transport/bsdf/ward.h"
#include "transport/resolve_bsdf.h"

namespace ambilux {

/// Calls `op` with the BSDF that `b` stands for; `otherwise` when kernels of features F do not know it.
template <Features F, typename Result, typename Op>
AMBILUX_HD Result with_bsdf(const Bsdf& b, Result otherwise, Op op) {
    return visit_bsdf<F>(b.type, otherwise, [&](auto model) -> Result {
        using Model = typename decltype(model)::type;
        if constexpr (F.phong_facets && requires { b.as<Model>().distribution; })
            if (b.as<Model>().distribution == Microfacets::phong) {
                if constexpr (Model::tabulated)
                    return op(BsdfAt<Model, PhongFacets>{b.as<Model>(), b.tables});
                else
                    return op(BsdfAt<Model, PhongFacets>{b.as<Model>()});
            }
        if constexpr (Model::tabulated)
            return op(BsdfAt<Model>{b.as<Model>(), b.tables});
        else
            return op(BsdfAt<Model>{b.as<Model>()});
    });
}

namespace detail {

/// Without its coating.
template <Features F>
AMBILUX_HD BsdfValue evaluate_base(const Bsdf& b, Vec3f wi, Vec3f wo, TransportMode mode) {
    return with_bsdf<F>(b, no_scattering(), [&](const auto& bsdf) -> BsdfValue {
        constexpr bool kSmooth = requires { bsdf.evaluate(wi, wo, mode); };
        static_assert(kSmooth == std::remove_cvref_t<decltype(bsdf)>::Model::smooth, "smooth ones have evaluate");
        if constexpr (kSmooth)
            return bsdf.evaluate(wi, wo, mode);
        else
            return no_scattering();
    });
}

template <Features F>
AMBILUX_HD_APART BsdfValue bsdf_evaluate_apart(Bsdf b, Vec3f wi, Vec3f wo, TransportMode mode) {
    if constexpr (F.coats)
        if (b.coat)
            return coated_evaluate(Coat{b.coat}, wi, wo,
                                   [&](Vec3f in, Vec3f out) { return evaluate_base<F>(b, in, out, mode); });
    return evaluate_base<F>(b, wi, wo, mode);
}

template <Features F>
AMBILUX_HD bool sample_base(const Bsdf& b, Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) {
    return with_bsdf<F>(b, false, [&](const auto& bsdf) { return bsdf.sample(wi, u, mode, out); });
}

struct SampleOrNone {
    BsdfSample sample;
    bool valid;
};

template <Features F>
AMBILUX_HD_APART SampleOrNone bsdf_sample_apart(Bsdf b, Vec3f wi, Vec3f u, TransportMode mode) {
    SampleOrNone s;
    if constexpr (F.coats)
        if (b.coat) {
            s.valid = coated_sample(
                Coat{b.coat}, wi, u, [&](Vec3f in, Vec3f wo) { return evaluate_base<F>(b, in, wo, mode); },
                [&](Vec3f in, Vec3f rest, BsdfSample& below) { return sample_base<F>(b, in, rest, mode, below); },
                s.sample);
            return s;
        }
    s.valid = sample_base<F>(b, wi, u, mode, s.sample);
    return s;
}

}  // namespace detail

/// f(wi,wo)·|cos(wo)| of the smooth lobes, and the densities of both directions per solid angle over them, the chance
/// of choosing them included; 0 where sides do not fit. Finite and not negative for cosines of 0 and from 1e-30 on.
template <Features F>
AMBILUX_HD BsdfValue bsdf_evaluate(const Bsdf& b, Vec3f wi, Vec3f wo, TransportMode mode) {
    if constexpr (F.bsdfs == bit(BsdfType::diffuse)) {
        return BsdfAt<Diffuse>{b.as<Diffuse>()}.evaluate(wi, wo, mode);
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

/// Draws wo from uniform u in [0,1)³ (x: lobe). False when nothing is scattered; `out` is then unspecified. Densities
/// of smooth lobes are those of bsdf_evaluate bit for bit, the weight is its value over pdf_sa to 4 roundings.
template <Features F>
AMBILUX_HD bool bsdf_sample(const Bsdf& b, Vec3f wi, Vec3f u, TransportMode mode, BsdfSample& out) {
    if constexpr (F.bsdfs == bit(BsdfType::diffuse)) {
        return BsdfAt<Diffuse>{b.as<Diffuse>()}.sample(wi, u, mode, out);
    } else {
        const detail::SampleOrNone s = detail::bsdf_sample_apart<F>(b, wi, u, mode);
        if (s.valid) out = s.sample;
        return s.valid;
    }
}

}  // namespace ambilux
