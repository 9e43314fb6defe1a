// What every BSDF takes and returns. Conventions: transport/bsdf.h.
#pragma once

#include "core/math.h"

namespace ambilux {

struct MicrofacetDistribution;

/// Parameters of a model at a point and its functions: a specialisation in transport/bsdf/NAME.h for every model of the
/// list, derived from Resolved<Model>. Smooth ones have `evaluate`, all of them `sample`. `Facets`: how normals of
/// microfacets are distributed, of models that have a choice (transport/bsdf/microfacet.h).
template <class Model, class Facets = MicrofacetDistribution>
struct BsdfAt;

enum class TransportMode : uint32_t { radiance, importance };

enum ScatterFlags : uint32_t {
    kScatterDelta = 1,         ///< sampled from a delta lobe: pdf_sa is a probability (mass), not a density
    kScatterTransmission = 2,  ///< wi and wo on different sides
};

/// Result of sampling a BSDF.
struct BsdfSample {
    Vec3f wo;
    float pdf_sa;          ///< density per solid angle of all smooth lobes together; for a delta lobe its probability
    float pdf_reverse_sa;  ///< BsdfValue::pdf_reverse_sa; of a delta lobe unspecified
    Rgb weight;            ///< f·|cos(wo)|/pdf
    float eta;       ///< relative index passed through (interior/exterior seen along the subpath); 1 without refraction
    uint32_t flags;  ///< ScatterFlags
};

/// f·|cos(wo)| and the densities of both directions together: sample, eval and pdf of a BSDF share one formula, and
/// subpaths that are connected need all three.
struct BsdfValue {
    Rgb value;
    float pdf_sa;          ///< density of wo per solid angle at wi
    float pdf_reverse_sa;  ///< density of wi per solid angle at wo: pdf_sa with the two exchanged
};

AMBILUX_HD BsdfValue no_scattering() { return {{0.0f, 0.0f, 0.0f}, 0.0f, 0.0f}; }

/// Fills `out` for a direction drawn from a smooth lobe; false if the density is out of range there (rounding,
/// underflow).
AMBILUX_HD bool smooth_sample(Vec3f wo, BsdfValue v, float eta, uint32_t flags, BsdfSample& out) {
    if (!(v.pdf_sa > 0.0f && v.pdf_sa < kInfinity)) return false;
    out = {wo, v.pdf_sa, v.pdf_reverse_sa, v.value / v.pdf_sa, eta, flags};
    return is_finite(out.weight);
}

/// bsdf.formula(...) for BSDFs whose evaluate() is long.
template <class Bsdf, class... Rest>
AMBILUX_HD_APART BsdfValue formula_apart(Bsdf bsdf, Rest... rest) {
    return bsdf.formula(rest...);
}

}  // namespace ambilux
