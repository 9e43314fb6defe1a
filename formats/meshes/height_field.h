// Surfaces of heights on a grid, as triangles.
#pragma once

#include "formats/images/image_io.h"
#include "formats/meshes/mesh.h"

namespace ambilux {

/// Over [-1,1]², row 0 of the heights along y = -1, (u,v) from 0 to 1, normal to +z. Cells are bilinear patches: four
/// triangles around the middle, two if there are many cells. `smooth`: with vertex normals, which are the means of the
/// patches' own (Mitsuba 0.6).
Mesh mesh_of_heights(const std::string& path, uint32_t width, uint32_t height, const std::vector<float>& heights,
                     bool smooth, const Limits& limits = {});

/// The same of an image: its luminance, linear, times `scale`.
Mesh mesh_of_image(const std::string& path, const Texels& texels, double scale, bool smooth, const Limits& limits = {});

}  // namespace ambilux
