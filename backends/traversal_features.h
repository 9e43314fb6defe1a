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

/// Triangles and analytic shapes alike.
constexpr Features kOpaqueShapes = {0, 0, kAllFeatures.primitives, false, false, false};

/// Scenes with instances.
constexpr Features kOpaqueInstances = {0, 0, kAllFeatures.primitives, false, false, false, false, false, false, true};

/// f(FeatureSet) with the least of these that tracing rays through a scene of `features` needs, or with `kOwn`, the
/// features of the calling kernels: masked shapes look textures up as their shading does, by the same function (a set
/// of their own made extend 19 % slower on an H100). Throws std::logic_error if `kOwn` does not cover what is needed.
template <Features kOwn = kAllFeatures, class Function>
auto with_traversal_features(const Features& features, Function f) {
    const bool triangles = !features.has_quadrics() && !features.instances, opaque = !features.opacity;
    constexpr bool kMasks = kOwn.covers(kMaskedTriangles), kShapes = kOwn.covers(kOpaqueShapes);
    if (triangles && opaque) return f(FeatureSet<kOpaqueTriangles>{});
    if constexpr (kMasks)
        if (triangles) return f(FeatureSet<kMaskedTriangles>{});
    if constexpr (kShapes)
        if (opaque && !features.instances) return f(FeatureSet<kOpaqueShapes>{});
    if constexpr (kOwn.covers(kOpaqueInstances))
        if (opaque) return f(FeatureSet<kOpaqueInstances>{});
    if constexpr (kMasks && kShapes)
        if (kOwn.instances || !features.instances) return f(FeatureSet<kOwn>{});
    throw std::logic_error("no kernel traces rays of this scene: its level of features is too small");
}

}  // namespace ambilux
