// The two kinds of scene that ray traversal by itself is compiled for.
#pragma once

#include "core/features.h"

namespace ambilux {

/// Triangles that stop every ray. All else is traced with kAllFeatures.
constexpr Features kOpaqueTriangles = {0, 0, bit(PrimitiveType::triangle), false, false, false};

/// True if kOpaqueTriangles is enough to trace rays through a scene of these features.
constexpr bool are_opaque_triangles(const Features& features) { return !features.has_quadrics() && !features.opacity; }

}  // namespace ambilux
