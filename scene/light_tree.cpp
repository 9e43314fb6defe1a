#include "scene/light_tree.h"

#include <algorithm>

#include "scene/scene.h"

namespace ambilux {

bool is_in_light_tree(const Emitter& e) {
    return e.pick_probability > 0.0f && !is_infinite(e.type) && !is_beam(e.type);
}

bool has_light_leaf_per_triangle(const Emitter& e) { return e.type == EmitterType::area && e.area_cdf != kNone; }

uint64_t light_leaf_count(const Scene& scene) {
    uint64_t count = 0;
    for (const Emitter& e : scene.emitters)
        if (is_in_light_tree(e)) count += has_light_leaf_per_triangle(e) ? scene.shapes[e.shape].primitive_count : 1;
    return count;
}

uint64_t light_tree_bytes(const Scene& scene) {
    const uint64_t leaves = light_leaf_count(scene);
    const auto beside = std::count_if(scene.emitters.begin(), scene.emitters.end(), [](const Emitter& e) {
        return is_infinite(e.type) && e.pick_probability > 0.0f;
    });
    return (leaves ? 2 * leaves - 1 : 0) * sizeof(LightNode) + leaves * sizeof(LightLeaf) +
           (scene.emitters.size() + uint64_t(beside)) * sizeof(uint32_t) + sizeof(LightTreeView);
}

bool light_tree_pays(const Scene& scene) {
    return light_leaf_count(scene) > 2 ||
           std::count_if(scene.emitters.begin(), scene.emitters.end(), is_in_light_tree) > 1;
}

}  // namespace ambilux
