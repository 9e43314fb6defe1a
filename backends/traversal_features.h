// The kinds of scene that ray traversal by itself is compiled for.
#pragma once

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
constexpr Features kMaskedShapes = {0, 0, kAllFeatures.primitives, true, false, true};

/// Scenes with instances.
constexpr Features kOpaqueInstances = {0, 0, kAllFeatures.primitives, false, false, false, false, false, false, true};
constexpr Features kMaskedInstances = {0, 0, kAllFeatures.primitives, true, false, true, false, false, false, true};

/// f(FeatureSet) with the least of the six above that tracing rays through a scene of `features` needs.
template <class Function>
auto with_traversal_features(const Features& features, Function f) {
    if (features.instances && features.opacity) return f(FeatureSet<kMaskedInstances>{});
    if (features.instances) return f(FeatureSet<kOpaqueInstances>{});
    if (features.has_quadrics() && features.opacity) return f(FeatureSet<kMaskedShapes>{});
    if (features.has_quadrics()) return f(FeatureSet<kOpaqueShapes>{});
    if (features.opacity) return f(FeatureSet<kMaskedTriangles>{});
    return f(FeatureSet<kOpaqueTriangles>{});
}

}  // namespace ambilux
