// Faces of more than three corners.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/vec3d.h"

namespace ambilux {

using Triangles = std::vector<std::array<uint32_t, 3>>;

/// Numbers of the corners of triangles that cover a polygon: a fan from the first corner, or where that would reach
/// beyond a concave polygon, its ears. What crosses itself becomes a fan. There are two triangles fewer than corners.
void cut_polygon(const std::vector<Vec3d>& corners, Triangles& triangles);

}  // namespace ambilux
