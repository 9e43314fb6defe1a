// Curves with a radius, as triangles.
#pragma once

#include "formats/meshes/mesh.h"

namespace ambilux {

struct CurvePoint {
    double p[3], radius;
};
using Curve = std::vector<CurvePoint>;

/// Text with "x y z radius" in each line; empty lines part the curves.
std::vector<Curve> read_curves(const std::string& path, std::string_view text, const Limits& limits = {});

/// Segments between the points, with spheres at them: cones that touch both spheres of a segment.
Mesh mesh_of_linear_curves(const std::vector<Curve>& curves);
/// Uniform cubic B-splines: circles across the curve, open at its ends. Curves of less than four points are refused.
Mesh mesh_of_bspline_curves(const std::string& path, const std::vector<Curve>& curves);

/// How many sides curves of that many segments in all have.
uint32_t sides_of_curves(uint64_t segments);

}  // namespace ambilux
