// The light vertices of a sample as plain arrays.
#pragma once

#include <array>
#include <vector>

#include "render/replay/replay.h"
#include "scene/scene.h"

namespace ambilux {

/// Where light subpaths of one sample met a surface: one entry a vertex, ordered by light subpath and depth.
struct LightVertices {
    std::vector<std::array<double, 3>> positions;    ///< in coordinates of the scene's file
    std::vector<Vec3f> normals, directions;          ///< shading normals; of the rays that arrive
    std::vector<Rgb> throughputs;                    ///< of these rays: power, for a light subpath of its own
    std::vector<uint32_t> depths, subpaths, shapes;  ///< segments from the light; number of the light subpath
    std::vector<uint8_t> connectible;                ///< 0 on mirrors and glass, which a cache leaves out
    uint32_t subpath_count = 0;                      ///< light subpaths of the sample, those that met nothing included
};

/// All light subpaths of `sample` again. Throws Error(usage) if the render has none.
LightVertices light_vertices(const Replay& replay, const Scene& scene, uint32_t sample);

}  // namespace ambilux
