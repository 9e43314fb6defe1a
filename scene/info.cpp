#include "scene/info.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "core/sha256.h"
#include "scene/light_tree.h"

namespace ambilux {

const char* name_of(FilterType type) {
    static const char* names[] = {"box", "tent", "gaussian"};
    return names[size_t(type)];
}

std::vector<std::string> feature_names(const Features& f) {
    std::vector<std::string> names;
    const auto add = [&](auto count) {
        for (uint32_t i = 0; i < uint32_t(count); ++i)
            if (f.has(decltype(count)(i))) names.push_back(name_of(decltype(count)(i)));
    };
    add(BsdfType::count);
    add(EmitterType::count);
    add(PrimitiveType::count);
    if (f.textures) names.push_back("textures");
    if (f.bumps) names.push_back("bumps");
    if (f.opacity) names.push_back("opacity");
    if (f.blends) names.push_back("blends");
    if (f.coats) names.push_back("coatings");
    if (f.map_rules) names.push_back("rules of maps");
    if (f.phong_facets) names.push_back("phong microfacets");
    if (f.instances) names.push_back("instances");
    if (f.latlong) names.push_back("spherical sensor");
    if (f.sampling) names.push_back("sampling");
    return names;
}

namespace {

/// What is shown in several places, and the memory of its triangles if each place had a copy.
nlohmann::json instances_info(const Scene& scene) {
    const SceneView view = scene.view();
    uint64_t grouped = 0;
    std::vector<uint64_t> vertices;
    for (const Group& g : scene.groups) {
        grouped += g.triangle_count;
        uint32_t first = kNone, last = 0;
        for (uint32_t i = 0; i < g.triangle_count; ++i) {
            const Triangle& t = scene.triangles[g.first_triangle + i];
            for (uint32_t v : {t.v0, t.v1, t.v2}) first = std::min(first, v), last = std::max(last, v);
        }
        vertices.push_back(g.triangle_count ? last - first + 1 : 0);
    }
    uint64_t copies = uint64_t(view.instanced_count) * (sizeof(Triangle) + sizeof(uint16_t));
    for (const Instance& i : scene.instances) copies += vertices[i.group] * sizeof(MeshVertex);
    return {{"groups", scene.groups.size()},
            {"group_triangles", grouped},
            {"count", scene.instances.size()},
            {"triangles", view.instanced_count},
            {"bytes", scene.instances.size() * sizeof(Instance)},
            {"bytes_of_copies", copies}};
}

nlohmann::json sensor_info(const Sensor& s) {
    const double degrees = 360 / M_PI;
    nlohmann::json sensor = {{"type", name_of(s.type)}};
    if (!is_latlong(s.type)) {
        sensor["near_clip"] = s.near_clip;
        sensor["far_clip"] = s.far_clip;
    }
    if (is_parallel(s.type))
        sensor["half_extent"] = {s.tan_half_fov.x, s.tan_half_fov.y};
    else if (!is_latlong(s.type))
        sensor["fov_degrees"] = {std::atan(s.tan_half_fov.x) * degrees, std::atan(s.tan_half_fov.y) * degrees};
    if (s.type == SensorType::thin_lens) {
        sensor["aperture_radius"] = s.aperture_radius;
        sensor["focus_distance"] = s.focus_distance;
    }
    return sensor;
}

}  // namespace

nlohmann::json scene_info(const Scene& scene) {
    std::map<std::string, uint64_t> shapes, bsdfs, emitters, textures;
    for (const Shape& shape : scene.shapes) {
        const bool mesh = shape.primitive_count == 0 || shape.first_primitive < scene.triangles.size();
        ++shapes[mesh ? "mesh" : name_of(scene.quadrics[shape.first_primitive - scene.triangles.size()].type)];
    }
    for (const BsdfRecord& b : scene.bsdfs) ++bsdfs[name_of(b.type)];
    for (const Emitter& e : scene.emitters) ++emitters[name_of(e.type)];
    for (const Texture& t : scene.textures) ++textures[t.type == TextureType::bitmap ? "bitmap" : "checkerboard"];
    const Sensor& s = scene.sensor;
    return {
        {"scene", scene.path},
        {"content_hash", to_hex(scene.content_hash)},
        {"shapes", shapes},
        {"triangles", scene.triangles.size()},
        {"degenerate_triangles", scene.degenerate_triangles},
        {"vertices", scene.vertices.size()},
        {"quadrics", scene.quadrics.size()},
        {"instances", instances_info(scene)},
        {"materials", scene.materials.size()},
        {"bsdfs", bsdfs},
        {"textures", textures},
        {"texel_bytes", scene.texels.size()},
        {"emitters", emitters},
        {"memory_bytes", scene.memory_bytes()},
        {"light_tree", {{"lights", light_leaf_count(scene)}, {"bytes", light_tree_bytes(scene)}}},
        {"bounds",
         {{"center", {scene.bounds_center.x, scene.bounds_center.y, scene.bounds_center.z}},
          {"radius", scene.bounds_radius}}},
        {"sensor", sensor_info(s)},
        {"film",
         {{"width", s.film_width},
          {"height", s.film_height},
          {"crop", {s.crop_x, s.crop_y, s.crop_width, s.crop_height}},
          {"filter", name_of(s.filter)},
          {"filter_radius", s.filter_radius}}},
        {"integrator",
         {{"type", scene.integrator.type},
          {"max_depth", scene.integrator.max_depth},
          {"rr_depth", scene.integrator.rr_depth},
          {"spp", scene.integrator.spp},
          {"hide_emitters", scene.integrator.hide_emitters}}},
        {"features", feature_names(scene.features)},
        {"warnings", scene.warnings},
        {"notes", scene.notes},
    };
}

}  // namespace ambilux
