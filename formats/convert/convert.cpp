#include "formats/convert/convert.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>

#include "core/atomic_file.h"
#include "formats/convert/writer.h"
#include "scene/flatten.h"

namespace ambilux {
namespace convert {
namespace {

double degrees(double radians) { return radians * (180 / M_PI); }

void add_integrator(Writer& w, xml_node root) {
    const IntegratorHint& hint = w.scene.integrator;
    // Where a light needs one, path would be black.
    const bool kept = hint.type == "bdpt" && w.scene.features.has_beams();
    if (hint.type == "bdpt")
        w.note(std::string("Mitsuba 3 has no bidirectional integrator") + (kept ? "" : ": path stands for it"));
    xml_node node = add_object(root, "integrator", hint.type == "light" ? "ptracer" : kept ? "bdpt" : "path");
    add_integer(node, "max_depth", hint.max_depth);
    add_integer(node, "rr_depth", hint.rr_depth);
    if (hint.hide_emitters) add_boolean(node, "hide_emitters", true);
}

void add_film(Writer& w, xml_node sensor) {
    const Sensor& s = w.scene.sensor;
    xml_node film = add_object(sensor, "film", "hdrfilm");
    add_integer(film, "width", s.film_width);
    add_integer(film, "height", s.film_height);
    if (s.crop_width != s.film_width || s.crop_height != s.film_height) {
        add_integer(film, "crop_offset_x", s.crop_x);
        add_integer(film, "crop_offset_y", s.crop_y);
        add_integer(film, "crop_width", s.crop_width);
        add_integer(film, "crop_height", s.crop_height);
    }
    add_text(film, "pixel_format", "rgb");
    switch (s.filter) {
        case FilterType::box: {
            xml_node filter = add_object(film, "rfilter", "box");
            if (s.filter_radius == 0.5f) break;
            add_number(filter, "radius", s.filter_radius);
            w.note("Mitsuba 3 has no box filters but of radius 0.5");
            break;
        }
        case FilterType::tent: add_number(add_object(film, "rfilter", "tent"), "radius", s.filter_radius); break;
        case FilterType::gaussian:
            add_number(add_object(film, "rfilter", "gaussian"), "stddev", s.filter_radius / 4);
            break;
    }
}

const char* plugin_of(EmitterType type) {
    const char* plugin = "";
    EmitterModels::for_each([&](auto model) {
        using Model = typename decltype(model)::type;
        if (type == kEmitterType<Model>) plugin = Model::plugin;
    });
    return plugin;
}

/// The map with its columns scaled.
Affine scaled(Affine a, double x, double y) {
    for (auto& row : a.m) row[0] = float(row[0] * x), row[1] = float(row[1] * y);
    return a;
}

}  // namespace

void add_sensor(Writer& w, xml_node root) {
    const Sensor& s = w.scene.sensor;
    xml_node node = add_object(root, "sensor", plugin_of(s.type));
    if (is_latlong(s.type)) {
        add_transform(node, "to_world", s.to_world);
        w.note(fmt::format("Mitsuba 3 has no sensor '{}'", plugin_of(s.type)));
    } else if (is_parallel(s.type)) {
        const double aspect = double(s.film_width) / s.film_height;
        add_transform(node, "to_world", scaled(s.to_world, s.tan_half_fov.x, s.tan_half_fov.y * aspect));
    } else {
        add_transform(node, "to_world", s.to_world);
        add_number(node, "fov", degrees(2 * std::atan(double(s.tan_half_fov.x))));
        add_text(node, "fov_axis", "x");
        if (s.principal_offset.x != 0) add_number(node, "principal_point_offset_x", s.principal_offset.x);
        if (s.principal_offset.y != 0) add_number(node, "principal_point_offset_y", s.principal_offset.y);
    }
    if (!is_latlong(s.type)) {
        add_number(node, "near_clip", s.near_clip);
        add_number(node, "far_clip", s.far_clip);
    }
    if (has_lens(s.type)) {
        add_number(node, "aperture_radius", s.aperture_radius);
        add_number(node, "focus_distance", s.focus_distance);
    }
    add_film(w, node);
    add_integer(add_object(node, "sampler", "independent"), "sample_count", w.scene.integrator.spp);
}

void add_emitter(Writer& w, xml_node parent, const Emitter& e) {
    xml_node node = add_object(parent, "emitter", plugin_of(e.type));
    switch (e.type) {
        case EmitterType::hidden_area: w.note("Mitsuba 3 has no emitter 'hiddenarea'"); [[fallthrough]];
        case EmitterType::area:
        case EmitterType::directional_area:
        case EmitterType::constant: return add_color(w, node, "radiance", e.radiance);
        case EmitterType::collimated: {
            const Frame frame = frame_from_normal(e.direction);
            Affine to_world{};
            for (int i = 0; i < 3; ++i) {
                const float row[4] = {frame.s[i], frame.t[i], frame.n[i], e.position[i]};
                std::copy(row, row + 4, to_world.m[i]);
            }
            add_transform(node, "to_world", to_world);
            add_rgb(node, "power", e.radiance.value);
            return w.note("Mitsuba 3 has no emitter 'collimated'");
        }
        case EmitterType::point:
            add_vector(node, "point", "position", e.position);
            return add_color(w, node, "intensity", e.radiance);
        case EmitterType::directional:
            add_vector(node, "vector", "direction", e.direction);
            return add_color(w, node, "irradiance", e.radiance);
        case EmitterType::spot:
            add_transform(node, "to_world", e.to_world);
            add_number(node, "cutoff_angle", degrees(e.cutoff));
            add_number(node, "beam_width", degrees(e.beam_width));
            add_rgb(node, "intensity", e.radiance.value);
            if (e.radiance.texture >= 0) add_texture(w, node, "texture", e.radiance.texture, splat(1), false);
            return;
        case EmitterType::projector: {
            add_transform(node, "to_world", e.to_world);
            add_number(node, "fov", degrees(2 * std::atan(double(e.cutoff))));
            add_text(node, "fov_axis", "x");
            ParamRgb irradiance = e.radiance;
            irradiance.value = irradiance.value * float(1 / M_PI);  // the loader multiplies, as Mitsuba does
            return add_color(w, node, "irradiance", irradiance);
        }
        case EmitterType::envmap:
            add_text(node, "filename", float_image(w, w.scene.textures[size_t(e.radiance.texture)], splat(1)));
            add_number(node, "scale", e.radiance.value.x);
            return add_transform(node, "to_world", e.to_world);
        case EmitterType::count: return;
    }
}

}  // namespace convert

std::vector<std::string> write_mitsuba(const Scene& scene, const std::string& path) {
    namespace fs = std::filesystem;
    if (!scene.instances.empty()) {
        std::vector<std::string> notes = write_mitsuba(flatten_instances(scene), path);
        notes.push_back("every instance is written as a copy");
        return notes;
    }
    const std::string stem = fs::path(path).stem().string() + "_files";
    convert::Writer w{scene, (fs::path(path).parent_path() / stem).string(), stem, {}, {}, {}};
    make_folders(w.folder);
    if (scene.origin != std::array<double, 3>{})
        w.note(fmt::format("coordinates count from ({}, {}, {}) of the original", scene.origin[0], scene.origin[1],
                           scene.origin[2]));
    pugi::xml_document document;
    pugi::xml_node root = document.append_child("scene");
    root.append_attribute("version") = "3.0.0";
    convert::add_integrator(w, root);
    convert::add_sensor(w, root);
    std::set<uint32_t> materials;
    for (const Shape& shape : scene.shapes)
        if (shape.primitive_count && materials.insert(shape.material).second)
            convert::add_material(w, root, shape.material, fmt::format("material{}", shape.material));
    for (const Emitter& e : scene.emitters)
        if (!is_on_surface(e.type)) convert::add_emitter(w, root, e);
    convert::add_shapes(w, root);
    std::ostringstream text;
    document.save(text, "    ");
    write_file_atomic(path, text.str());
    return w.notes;
}

}  // namespace ambilux
