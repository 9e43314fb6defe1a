// Surfaces of signed distances on a grid, as triangles.
#pragma once

#include "formats/meshes/mesh.h"

namespace ambilux {

/// Values at the corners of cells that fill [0,1]³, x fastest.
struct DistanceGrid {
    uint32_t size[3];  ///< corners along x, y and z, at least 2
    std::vector<float> values;

    float at(uint32_t x, uint32_t y, uint32_t z) const { return values[(size_t(z) * size[1] + y) * size[0] + x]; }
};

/// Mitsuba's .vol format, version 3, of floats in one channel.
DistanceGrid read_distance_grid(const std::string& path, std::string_view bytes, const Limits& limits = {});

enum class GridNormals { smooth, analytic };

/// Where the trilinear interpolant is 0, its normals to the positive side. Cells are cut into tetrahedra of a half of
/// their width, or of their whole width if there are many; corners of triangles lie on the surface. Normals are those
/// of the interpolant or smoothed (Hansson-Söderlund et al. 2022, "Ray Tracing of Signed Distance Function Grids").
Mesh mesh_of_grid(const std::string& path, const DistanceGrid& grid, GridNormals normals);

}  // namespace ambilux
