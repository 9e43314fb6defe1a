// The kinds of scene that ray traversal by itself is compiled for.
#pragma once

#include <stdexcept>

#include "models/features.h"

namespace ambilux {

/// Features as a type. Kernels take this one: the host code that nvcc makes for a kernel cannot name a struct that is a
/// template argument itself.
template <Features F>
struct FeatureSet {
    static constexpr Features value = F;
};

constexpr Features kOpaqueTriangles = {0, 0, bit(PrimitiveType::triangle), false, false, false};
/// Triangles of partial opacity, textured or not.
constexpr Features kMaskedTriangles = {0, 0, bit(PrimitiveType::triangle), true, false, true};

constexpr Features kOpaqueShapes = {0, 0, kAllFeatures.primitives, false, false, false};

/// f(FeatureSet) with the least of these that tracing rays through a scene of `features` needs, or with `kOwn`, the
/// features of the calling kernels: masked quadrics look textures up as their shading does, by the same function (a set
/// of their own made extend 19 % slower on an H100). Throws std::logic_error if `kOwn` does not cover what is needed.
template <Features kOwn = kAllFeatures, class Function>
auto with_traversal_features(const Features& features, Function f) {
    const bool quadrics = features.has_quadrics(), opacity = features.opacity;
    if (!quadrics && !opacity) return f(FeatureSet<kOpaqueTriangles>{});
    if constexpr (kOwn.covers(kMaskedTriangles))
        if (!quadrics) return f(FeatureSet<kMaskedTriangles>{});
    if constexpr (kOwn.covers(kOpaqueShapes))
        if (!opacity) return f(FeatureSet<kOpaqueShapes>{});
    if constexpr (kOwn.covers(kMaskedTriangles) && kOwn.covers(kOpaqueShapes))
        if (quadrics && opacity) return f(FeatureSet<kOwn>{});
    throw std::logic_error("no kernel traces rays of this scene: its level of features is too small");
}

}  // namespace ambilux
