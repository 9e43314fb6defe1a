#include "scene/info.h"

#include <cmath>
#include <map>

#include "core/sha256.h"

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
    return names;
}

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
    const double degrees = 360 / M_PI;
    nlohmann::json sensor = {{"type", name_of(s.type)}, {"near_clip", s.near_clip}, {"far_clip", s.far_clip}};
    if (s.type == SensorType::orthographic)
        sensor["half_extent"] = {s.tan_half_fov.x, s.tan_half_fov.y};
    else
        sensor["fov_degrees"] = {std::atan(s.tan_half_fov.x) * degrees, std::atan(s.tan_half_fov.y) * degrees};
    if (s.type == SensorType::thin_lens) {
        sensor["aperture_radius"] = s.aperture_radius;
        sensor["focus_distance"] = s.focus_distance;
    }
    return {
        {"scene", scene.path},
        {"content_hash", to_hex(scene.content_hash)},
        {"shapes", shapes},
        {"triangles", scene.triangles.size()},
        {"degenerate_triangles", scene.degenerate_triangles},
        {"vertices", scene.vertices.size()},
        {"quadrics", scene.quadrics.size()},
        {"materials", scene.materials.size()},
        {"bsdfs", bsdfs},
        {"textures", textures},
        {"texel_bytes", scene.texels.size()},
        {"emitters", emitters},
        {"memory_bytes", scene.memory_bytes()},
        {"bounds",
         {{"center", {scene.bounds_center.x, scene.bounds_center.y, scene.bounds_center.z}},
          {"radius", scene.bounds_radius}}},
        {"sensor", sensor},
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
