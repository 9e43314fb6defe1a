// Curves with a radius, as triangles.
#pragma once

#include "core/vec3d.h"
#include "formats/meshes/mesh.h"

namespace ambilux {

struct CurvePoint {
    Vec3d p;
    double radius;
};
using Curve = std::vector<CurvePoint>;

/// Text with "x y z radius" in each line; empty lines part the curves.
std::vector<Curve> read_curves(const std::string& path, std::string_view text, const Limits& limits = {});

/// Segments between the points, with spheres at them: cones that touch both spheres of a segment.
Mesh mesh_of_linear_curves(const std::vector<Curve>& curves);
/// Uniform cubic B-splines: circles across the curve, open at its ends. Curves of less than four points are refused.
Mesh mesh_of_bspline_curves(const std::string& path, const std::vector<Curve>& curves);

/// At `x` in [0,1] of the segment of a cubic B-spline that has these four points, and by how much they change there.
struct SplinePlace {
    Vec3d center{}, tangent{};
    double radius = 0, slope = 0;
};
SplinePlace spline_at(const CurvePoint* points, double x);

/// How many sides curves of that many segments in all have.
uint32_t sides_of_curves(uint64_t segments);

}  // namespace ambilux
