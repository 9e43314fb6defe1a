// Blends of materials: every point of the surface is of one of them, by a hash of its place. A strategy of a
// bidirectional method that comes to the same point finds the same material there, and the image is that of the
// weighted sum of their BSDFs, because paths touch a surface in points of measure zero.
#pragma once

#include "core/float32.h"
#include "core/rng.h"
#include "scene/surface.h"
#include "transport/texture.h"

namespace ambilux {

/// Uniform in [0,1) for the place of a point and the number of a blend.
AMBILUX_HD float point_hash(Vec3f p, uint32_t blend) {
    const auto bits = [](float x) { return __builtin_bit_cast(uint32_t, float32(x)); };
    return hash_float(hash_word({bits(p.x), bits(p.y), bits(p.z), blend}), blend);
}

/// The material of a point: that of its shape, or one that it is blended of.
template <Features F>
AMBILUX_HD const Material& material_at(const SceneView& scene, const SurfacePoint& point) {
    uint32_t index = scene.shapes[point.shape].material;
    if constexpr (F.blends)
        while (scene.materials[index].first != kNone) {
            const Material& blend = scene.materials[index];
            const float weight = eval_float<F>(scene, blend.second_weight, point.uv);
            index = point_hash(point.p, index) < weight ? blend.second : blend.first;
        }
    return scene.materials[index];
}

}  // namespace ambilux
