// The BSDF interface: a value type with resolved parameters, evaluated in the local shading frame.
//
// Conventions (Mitsuba's, Veach 1997 chapter 5 for the two modes):
// - wi points to where the walk came from, wo to where it goes; both point away from the surface, unit, local frame, z = shading normal.
// - eval returns f(wi,wo)·|cos(wo)|, without delta lobes. sample returns eval/pdf as `weight`; for delta lobes the ratio in the limit.
// - TransportMode::radiance: walk from the camera; importance: walk from a light. They differ by eta² on refraction only; the factor for
//   shading normals is applied outside, once around all BSDFs (transport/surface_scattering.h).
// - pdf_sa is the density of wo per solid angle that sample uses; it is the same in both modes up to the swap of roles.
#pragma once

#include "scene/view.h"

namespace ambilux {

enum class TransportMode : uint32_t { radiance, importance };

enum ScatterFlags : uint32_t {
    kScatterDelta = 1,         ///< sampled from a delta lobe: pdf_sa is a probability (mass), not a density
    kScatterTransmission = 2,  ///< wi and wo on different sides
};

/// Result of sampling a BSDF.
struct BsdfSample {
    Vec3f wo;
    float pdf_sa;    ///< density per solid angle of all smooth lobes together; for a delta lobe its probability
    Rgb weight;      ///< f·|cos(wo)|/pdf
    float eta;       ///< relative index passed through (interior/exterior seen along the walk); 1 without refraction
    uint32_t flags;  ///< ScatterFlags
};
}  // namespace ambilux
