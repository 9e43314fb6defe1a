// The sets of features that kernels are compiled for, on both backends (cmake/instantiate.cmake has a translation unit
// for each). A scene gets the first that covers it.
#pragma once

#include "models/features.h"

namespace ambilux {

/// Diffuse triangles under area lights.
constexpr Features kDiffuseFeatures = {
    bit(BsdfType::diffuse), bit(EmitterType::area), bit(PrimitiveType::triangle), false, false, false};

/// What most scenes of light transport papers are made of: any shapes under area lights, no textures.
constexpr Features kUntexturedFeatures = {
    bit(BsdfType::diffuse) | bit(BsdfType::conductor) | bit(BsdfType::rough_conductor) | bit(BsdfType::dielectric),
    bit(EmitterType::area),
    kAllFeatures.primitives,
    false,
    false,
    false};

/// BSDFs of the levels below the last one. The others are seldom used and would make their kernels larger.
constexpr uint32_t kCommonBsdfs = bit(BsdfType::diffuse) | bit(BsdfType::rough_diffuse) | bit(BsdfType::conductor) |
                                  bit(BsdfType::rough_conductor) | bit(BsdfType::dielectric) |
                                  bit(BsdfType::thin_dielectric) | bit(BsdfType::rough_dielectric) |
                                  bit(BsdfType::plastic) | bit(BsdfType::rough_plastic);

/// Emitters of these levels.
constexpr uint32_t kCommonEmitters = bit(EmitterType::area) | bit(EmitterType::point) | bit(EmitterType::spot) |
                                     bit(EmitterType::directional) | bit(EmitterType::constant) |
                                     bit(EmitterType::envmap);

/// Every common BSDF, texture and emitter, on triangles that are neither bumped nor holed.
constexpr Features kTriangleFeatures = {kCommonBsdfs, kCommonEmitters, bit(PrimitiveType::triangle),
                                        true,         false,           false};

/// The same with holes.
constexpr Features kMaskedFeatures = {kCommonBsdfs, kCommonEmitters, bit(PrimitiveType::triangle), true, false, true};

/// All but the rarer BSDFs, emitters and sensors, blends, coatings and rules of maps.
constexpr Features kCommonFeatures = {kCommonBsdfs, kCommonEmitters, kAllFeatures.primitives, true, true, true};

/// All but instances, of which every kernel of the last level asks at every hit, and Phong's microfacets, which few
/// scenes have.
constexpr Features kFlatFeatures = [] {
    Features f = kAllFeatures;
    f.instances = f.phong_facets = false;
    return f;
}();

/// All, and lights picked by a tree and numbers from Sobol' points where settings ask for them. The level is compiled
/// for the methods that name it (integrators/registry.list).
constexpr Features kSamplingFeatures = [] {
    Features f = kAllFeatures;
    f.sampling = true;
    return f;
}();

/// Calls f.template operator()<F>() with the smallest level F that covers `needed`; with the full set if `specialise`
/// is false.
template <class Function>
decltype(auto) with_feature_level(const Features& needed, bool specialise, Function&& f) {
    if (specialise && kDiffuseFeatures.covers(needed)) return f.template operator()<kDiffuseFeatures>();
    if (specialise && kUntexturedFeatures.covers(needed)) return f.template operator()<kUntexturedFeatures>();
    if (specialise && kTriangleFeatures.covers(needed)) return f.template operator()<kTriangleFeatures>();
    if (specialise && kMaskedFeatures.covers(needed)) return f.template operator()<kMaskedFeatures>();
    if (specialise && kCommonFeatures.covers(needed)) return f.template operator()<kCommonFeatures>();
    if (specialise && kFlatFeatures.covers(needed)) return f.template operator()<kFlatFeatures>();
    return f.template operator()<kAllFeatures>();
}

}  // namespace ambilux
