#include "scene/scene.h"

namespace ambilux {

SceneView Scene::view() const {
    SceneView v{};
    v.vertices = vertices.data();
    v.triangles = triangles.data();
    v.quadrics = quadrics.data();
    v.shapes = shapes.data();
    v.materials = materials.data();
    v.bsdfs = bsdfs.data();
    v.textures = textures.data();
    v.texels = texels.data();
    v.sort_keys = sort_keys.data();
    v.emitters = emitters.data();
    v.emitter_cdf = emitter_cdf.data();
    v.tables = tables.data();
    v.environment_rows = environment_rows.data();
    v.environment_cells = environment_cells.data();
    v.vertex_count = uint32_t(vertices.size());
    v.triangle_count = uint32_t(triangles.size());
    v.quadric_count = uint32_t(quadrics.size());
    v.shape_count = uint32_t(shapes.size());
    v.material_count = uint32_t(materials.size());
    v.bsdf_count = uint32_t(bsdfs.size());
    v.texture_count = uint32_t(textures.size());
    v.emitter_count = uint32_t(emitters.size());
    v.environment = environment;
    v.bounds_center = bounds_center;
    v.bounds_radius = bounds_radius;
    v.sensor = sensor;
    v.groups = groups.data();
    v.instances = instances.data();
    v.group_count = uint32_t(groups.size());
    v.instance_count = uint32_t(instances.size());
    for (const Instance& i : instances) v.instanced_count += groups[i.group].triangle_count;
    return v;
}

bool same_geometry(const Scene& a, const Scene& b) {
    return same_array(a.vertices, b.vertices) && same_array(a.triangles, b.triangles) &&
           same_array(a.quadrics, b.quadrics) && same_array(a.instances, b.instances);
}

uint64_t Scene::memory_bytes() const {
    const auto bytes = [](const auto& array) { return uint64_t(array.size() * sizeof(array[0])); };
    return bytes(vertices) + bytes(triangles) + bytes(quadrics) + bytes(groups) + bytes(instances) + bytes(shapes) +
           bytes(materials) + bytes(bsdfs) + bytes(textures) + bytes(texels) + bytes(sort_keys) + bytes(emitters) +
           bytes(emitter_cdf) + bytes(tables) + bytes(environment_rows) + bytes(environment_cells);
}

}  // namespace ambilux
