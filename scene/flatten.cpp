#include "scene/flatten.h"

#include <algorithm>
#include <map>

#include "core/error.h"
#include "scene/placement.h"

namespace ambilux {

namespace {

/// Appends the triangles of an instance as shapes of their own.
void append_copy(const Scene& from, const Instance& instance, Scene& to) {
    const Group& group = from.groups[instance.group];
    std::map<uint32_t, uint32_t> shapes;  // of the group to those of the copy
    uint32_t first = kNone, last = 0;
    for (uint32_t i = 0; i < group.triangle_count; ++i) {
        const Triangle& t = from.triangles[group.first_triangle + i];
        for (uint32_t v : {t.v0, t.v1, t.v2}) first = std::min(first, v), last = std::max(last, v);
    }
    // A vertex belongs to one shape.
    std::vector<uint8_t> has_normals(group.triangle_count ? last - first + 1 : 0);
    const uint32_t base = uint32_t(to.vertices.size());
    for (uint32_t i = 0; i < group.triangle_count; ++i) {
        Triangle t = from.triangles[group.first_triangle + i];
        const Shape& shape = from.shapes[t.shape];
        if (shape.flags & kShapeHasNormals)
            for (uint32_t v : {t.v0, t.v1, t.v2}) has_normals[v - first] = 1;
        const auto [known, is_new] = shapes.try_emplace(t.shape, uint32_t(to.shapes.size()));
        if (is_new) {
            to.shapes.push_back(shape);
            to.shapes.back().first_primitive = uint32_t(to.triangles.size());
            to.shapes.back().primitive_count = 0;
        }
        ++to.shapes[known->second].primitive_count;
        t = {t.v0 - first + base, t.v1 - first + base, t.v2 - first + base, known->second};
        if (instance.mirrored) std::swap(t.v1, t.v2);
        to.triangles.push_back(t);
    }
    for (size_t v = 0; v < has_normals.size(); ++v)
        to.vertices.push_back(placed_vertex(instance, from.vertices[first + v], has_normals[v]));
}

}  // namespace

Scene flatten_instances(const Scene& scene) {
    if (scene.instances.empty()) return scene;
    Scene out = scene;
    out.groups.clear();
    out.instances.clear();
    out.features.instances = false;
    const SceneView view = scene.view();
    const uint32_t kept = view.ungrouped_count();
    if (uint64_t(kept) + view.instanced_count + scene.quadrics.size() >= kNone / 2)
        throw input_error(scene.path, 0, "without instances the scene has too many triangles");
    out.triangles.resize(kept);
    out.sort_keys.resize(kept);
    for (Shape& shape : out.shapes)
        if (shape.first_primitive >= kept && shape.first_primitive < view.triangle_count) shape.primitive_count = 0;
    for (const Instance& instance : scene.instances) append_copy(scene, instance, out);
    const uint32_t shift = uint32_t(out.triangles.size()) - view.triangle_count;  // modulo 2^32
    for (const Quadric& q : scene.quadrics) out.shapes[q.shape].first_primitive += shift;
    const SceneView flat = out.view();
    out.sort_keys.resize(flat.primitive_count());
    for (uint32_t prim = kept; prim < flat.primitive_count(); ++prim)
        out.sort_keys[prim] = uint16_t(std::min(out.shapes[flat.shape_of(prim)].material, kMostSortKeys - 1));
    return out;
}

}  // namespace ambilux
