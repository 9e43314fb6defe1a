#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "core/atomic_file.h"
#include "core/parallel.h"
#include "formats/convert/writer.h"

namespace ambilux::convert {

namespace {

static_assert(std::endian::native == std::endian::little);

template <class T>
void append(std::string& bytes, const T& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string ply_of(const Scene& scene, const Shape& shape) {
    const Triangle* triangles = scene.triangles.data() + shape.first_primitive;
    uint32_t first = kNone, last = 0;
    for (uint32_t i = 0; i < shape.primitive_count; ++i)
        for (uint32_t v : {triangles[i].v0, triangles[i].v1, triangles[i].v2})
            first = std::min(first, v), last = std::max(last, v);
    const uint32_t count = last - first + 1;
    const bool normals = shape.flags & kShapeHasNormals, uvs = shape.flags & kShapeHasUvs;
    std::string bytes = fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", count);
    for (const char* name : {"x", "y", "z"}) bytes += fmt::format("property float {}\n", name);
    if (normals)
        for (const char* name : {"nx", "ny", "nz"}) bytes += fmt::format("property float {}\n", name);
    if (uvs)
        for (const char* name : {"u", "v"}) bytes += fmt::format("property float {}\n", name);
    bytes +=
        fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n", shape.primitive_count);
    for (uint32_t i = 0; i < count; ++i) {
        const MeshVertex& v = scene.vertices[first + i];
        append(bytes, v.p);
        if (normals) append(bytes, v.n);
        if (uvs) append(bytes, v.uv());
    }
    for (uint32_t i = 0; i < shape.primitive_count; ++i) {
        bytes += char(3);
        for (uint32_t v : {triangles[i].v0, triangles[i].v1, triangles[i].v2}) append(bytes, v - first);
    }
    return bytes;
}

const char* plugin_of(PrimitiveType type) {
    switch (type) {
        case PrimitiveType::sphere: return "sphere";
        case PrimitiveType::disk: return "disk";
        default: return "cylinder";
    }
}

/// The side that must be written: a sphere that its own transform mirrors is turned over when it is read, as in
/// Mitsuba 3 (ShapeBuilder::read_placement).
bool written_flip(const Quadric& q) {
    const auto& m = q.to_world.m;
    const auto minor = [&](int i, int j) { return double(m[1][i]) * m[2][j] - double(m[1][j]) * m[2][i]; };
    const bool mirrors = m[0][0] * minor(1, 2) + m[0][1] * minor(2, 0) + m[0][2] * minor(0, 1) < 0;
    return (q.flip != 0) != (q.type == PrimitiveType::sphere && mirrors);
}

}  // namespace

void add_shapes(Writer& w, xml_node root) {
    const Scene& scene = w.scene;
    std::vector<uint32_t> meshes;
    for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
        const Shape& shape = scene.shapes[i];
        if (shape.primitive_count == 0) continue;
        xml_node node;
        if (shape.first_primitive < scene.triangles.size()) {
            node = add_object(root, "shape", "ply");
            add_text(node, "filename", fmt::format("{}/shape{:05}.ply", w.prefix, i));
            if (!(shape.flags & kShapeHasNormals)) add_boolean(node, "face_normals", true);
            meshes.push_back(i);
        } else {
            const Quadric& q = scene.quadrics[shape.first_primitive - scene.triangles.size()];
            node = add_object(root, "shape", plugin_of(q.type));
            add_transform(node, "to_world", q.to_world);
            if (written_flip(q)) add_boolean(node, "flip_normals", true);
        }
        node.append_child("ref").append_attribute("id") = fmt::format("material{}", shape.material).c_str();
        if (shape.emitter != kNone) add_emitter(w, node, scene.emitters[shape.emitter]);
    }
    parallel_for(meshes.size(), [&](size_t i) {
        write_file_atomic(fmt::format("{}/shape{:05}.ply", w.folder, meshes[i]),
                          ply_of(scene, scene.shapes[meshes[i]]));
    });
}

}  // namespace ambilux::convert
