// The sets of features that kernels are compiled for. A scene gets the first that covers it.
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

/// Every BSDF, texture and emitter, on triangles that are neither bumped nor holed.
constexpr Features kTriangleFeatures = {
    kAllFeatures.bsdfs, kAllFeatures.emitters, bit(PrimitiveType::triangle), true, false, false};

/// The same with holes.
constexpr Features kMaskedFeatures = {
    kAllFeatures.bsdfs, kAllFeatures.emitters, bit(PrimitiveType::triangle), true, false, true};

/// Carries a set of features as a type.
template <Features F>
struct FeatureTag {
    static constexpr Features value = F;
};

/// Calls `f` with the FeatureTag of the smallest level that covers `needed`; with the full set if `specialise` is
/// false.
template <class Function>
decltype(auto) with_feature_level(const Features& needed, bool specialise, Function&& f) {
    if (specialise && kDiffuseFeatures.covers(needed)) return f(FeatureTag<kDiffuseFeatures>{});
    if (specialise && kTriangleFeatures.covers(needed)) return f(FeatureTag<kTriangleFeatures>{});
    return f(FeatureTag<kAllFeatures>{});
}

/// The same with two levels more, for kernels of a device, where what is never called costs registers and room in
/// instruction caches.
template <class Function>
decltype(auto) with_kernel_level(const Features& needed, bool specialise, Function&& f) {
    if (specialise && !kDiffuseFeatures.covers(needed) && kUntexturedFeatures.covers(needed))
        return f(FeatureTag<kUntexturedFeatures>{});
    if (specialise && !kTriangleFeatures.covers(needed) && kMaskedFeatures.covers(needed))
        return f(FeatureTag<kMaskedFeatures>{});
    return with_feature_level(needed, specialise, f);
}

}  // namespace ambilux
