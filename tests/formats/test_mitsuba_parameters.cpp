// libs: ambilux_formats ambilux_accel
// timeout: 120
// Every parameter that Mitsuba 3.9 documents for a plugin that is read: it changes the scene, or is refused or noted.
#include <fmt/format.h>

#include <cstring>
#include <optional>

#include "formats/images/image_write.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/scene_contents.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

/// A plugin with what it needs; %s stands for further parameters.
struct Plugin {
    const char* name;
    std::string xml;
    std::vector<std::string> parameters;
};

std::string number(const char* name, const char* value = "0.37") {
    return fmt::format("<float name='{}' value='{}'/>", name, value);
}
std::string integer(const char* name, const char* value = "3") {
    return fmt::format("<integer name='{}' value='{}'/>", name, value);
}
std::string flag(const char* name, const char* value = "true") {
    return fmt::format("<boolean name='{}' value='{}'/>", name, value);
}
std::string text(const char* name, const char* value) {
    return fmt::format("<string name='{}' value='{}'/>", name, value);
}
std::string color(const char* name) { return fmt::format("<rgb name='{}' value='0.3, 0.4, 0.45'/>", name); }
std::string texture(const char* name) { return fmt::format("<texture type='checkerboard' name='{}'/>", name); }
const std::string kTransform = "<transform name='to_world'><translate x='1'/><rotate y='1' angle='20'/></transform>";

std::string on_shape(const std::string& bsdf) { return "<shape type='sphere'>" + bsdf + "</shape>"; }
std::string in_film(const std::string& film) {
    return "<sensor type='perspective'><float name='fov' value='40'/>" + film + "</sensor>";
}

std::vector<Plugin> shapes() {
    const std::string file = text("filename", "m.ply");
    const std::vector<std::string> all = {kTransform, flag("flip_normals"), number("silhouette_sampling_weight")};
    const auto with = [&](std::vector<std::string> own) {
        own.insert(own.end(), all.begin(), all.end());
        return own;
    };
    return {
        {"ply", "<shape type='ply'>" + file + "%s</shape>", with({flag("face_normals"), flag("flip_tex_coords")})},
        {"obj", "<shape type='obj'>" + text("filename", "m.obj") + "%s</shape>",
         with({flag("face_normals"), flag("flip_tex_coords", "false")})},
        {"sphere", "<shape type='sphere'>%s</shape>",
         with({"<point name='center' x='1' y='2' z='3'/>", number("radius")})},
        {"cylinder", "<shape type='cylinder'>%s</shape>",
         with({"<point name='p0' x='1'/>", "<point name='p1' x='1'/>", number("radius")})},
        {"disk", "<shape type='disk'>%s</shape>", with({})},
        {"rectangle", "<shape type='rectangle'>%s</shape>", with({})},
        {"cube", "<shape type='cube'>%s</shape>", with({})},
        {"sdfgrid", "<shape type='sdfgrid'>" + text("filename", "g.vol") + "%s</shape>",
         with({text("normals", "analytic"), flag("watertight", "false")})},
        {"linearcurve", "<shape type='linearcurve'>" + text("filename", "c.txt") + "%s</shape>", with({})},
        {"bsplinecurve", "<shape type='bsplinecurve'>" + text("filename", "c.txt") + "%s</shape>", with({})},
        {"merge", "<shape type='merge'><shape type='cube'/>%s</shape>", with({"<shape type='sphere'/>"})},
        {"instance",
         "<shape type='shapegroup' id='g'><shape type='cube'/></shape><shape type='instance'><ref id='g'/>%s</shape>",
         with({})},
    };
}

std::vector<Plugin> bsdfs() {
    const std::vector<std::string> rough = {text("distribution", "ggx"), number("alpha"), number("alpha_u"),
                                            number("alpha_v"), flag("sample_visible", "false")};
    const auto with = [&](std::vector<std::string> own) {
        own.insert(own.end(), rough.begin(), rough.end());
        return own;
    };
    const auto plugin = [](const char* type, std::vector<std::string> parameters) {
        return Plugin{type, on_shape(std::string("<bsdf type='") + type + "'>%s</bsdf>"), std::move(parameters)};
    };
    const std::vector<std::string> glass = {number("int_ior", "1.3"), number("ext_ior", "1.1"),
                                            color("specular_reflectance"), color("specular_transmittance")};
    const std::vector<std::string> metal = {text("material", "Au"), color("eta"), color("k"),
                                            color("specular_reflectance")};
    const std::vector<std::string> plastic = {color("diffuse_reflectance"), number("int_ior", "1.3"),
                                              number("ext_ior", "1.1"), color("specular_reflectance"),
                                              flag("nonlinear")};
    const std::vector<std::string> principled = {color("base_color"),   number("roughness"),
                                                 number("anisotropic"), number("spec_trans"),
                                                 number("eta", "1.3"),  number("spec_tint"),
                                                 number("sheen"),       number("sheen_tint"),
                                                 number("flatness"),    number("diffuse_reflectance_sampling_rate")};
    const auto and_more = [](std::vector<std::string> a, std::vector<std::string> b) {
        a.insert(a.end(), b.begin(), b.end());
        return a;
    };
    // All that both have may be textures.
    const auto textured = [](std::vector<std::string> all, std::initializer_list<const char*> names) {
        for (const char* name :
             {"base_color", "roughness", "anisotropic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness"})
            all.push_back(texture(name));
        for (const char* name : names) all.push_back(texture(name));
        return all;
    };
    return {
        plugin("diffuse", {color("reflectance")}),
        plugin("conductor", metal),
        plugin("roughconductor", with(metal)),
        plugin("dielectric", glass),
        plugin("thindielectric", glass),
        plugin("roughdielectric", with(glass)),
        plugin("plastic", plastic),
        plugin("roughplastic",
               and_more(plastic, {text("distribution", "ggx"), number("alpha"), flag("sample_visible", "false")})),
        plugin("principled",
               and_more(textured(principled, {"metallic", "clearcoat", "clearcoat_gloss"}),
                        {number("metallic"), number("specular"), number("clearcoat"), number("clearcoat_gloss"),
                         number("main_specular_sampling_rate"), number("clearcoat_sampling_rate")})),
        plugin("principledthin", and_more(textured(principled, {"diff_trans", "eta"}),
                                          {number("diff_trans"), number("specular_reflectance_sampling_rate"),
                                           number("specular_transmittance_sampling_rate"),
                                           number("diffuse_transmittance_sampling_rate")})),
        {"mask", on_shape("<bsdf type='mask'><bsdf type='diffuse'/>%s</bsdf>"), {number("opacity")}},
        {"blendbsdf",
         on_shape("<bsdf type='blendbsdf'>%s<bsdf type='diffuse'/><bsdf type='conductor'/></bsdf>"),
         {number("weight")}},
        {"bumpmap",
         on_shape("<bsdf type='bumpmap'><texture type='checkerboard'/>%s<bsdf type='diffuse'/></bsdf>"),
         {number("scale"), flag("flip_invalid_normals", "false"), flag("use_shadowing_function", "false")}},
    };
}

std::vector<Plugin> lights() {
    const auto plugin = [](const char* type, std::vector<std::string> parameters) {
        parameters.push_back(number("sampling_weight"));
        return Plugin{type, std::string("<emitter type='") + type + "'>%s</emitter>", std::move(parameters)};
    };
    return {
        plugin("point", {color("intensity"), "<point name='position' x='1'/>", kTransform}),
        plugin("spot", {color("intensity"), number("cutoff_angle", "31"), number("beam_width", "7"), kTransform,
                        "<texture name='texture' type='checkerboard'/>"}),
        plugin("projector", {color("irradiance"), number("scale"), kTransform, number("fov", "31"),
                             text("fov_axis", "y"), text("focal_length", "30mm")}),
        plugin("directional", {color("irradiance"), "<vector name='direction' x='1'/>", kTransform}),
        plugin("constant", {color("radiance")}),
        {"envmap",
         "<emitter type='envmap'><string name='filename' value='e.png'/>%s</emitter>",
         {number("scale"), kTransform, flag("mis_compensation"), number("sampling_weight")}},
        {"area",
         "<shape type='sphere'><emitter type='area'>%s</emitter></shape>",
         {color("radiance"), number("sampling_weight"), kTransform}},
        {"sunsky",
         "<emitter type='sunsky'>%s</emitter>",
         {number("sun_scale"), number("sun_aperture"), flag("complex_sun")}},
        // Without a sun the map is a quarter as large.
        {"sunsky",
         "<emitter type='sunsky'><float name='sun_scale' value='0'/>%s</emitter>",
         {number("turbidity", "5"), color("albedo"), number("sky_scale"), integer("hour", "11"),
          number("latitude", "50"), number("longitude", "8"), number("timezone", "2"), kTransform,
          number("sampling_weight")}},
    };
}

std::vector<Plugin> sensors() {
    const auto film = [](const char* type, std::vector<std::string> parameters) {
        return Plugin{type, in_film(std::string("<film type='") + type + "'>%s</film>"), std::move(parameters)};
    };
    const std::vector<std::string> lens = {kTransform,
                                           number("fov", "31"),
                                           text("focal_length", "30mm"),
                                           text("fov_axis", "y"),
                                           number("near_clip"),
                                           number("far_clip", "90"),
                                           number("principal_point_offset_x"),
                                           number("principal_point_offset_y"),
                                           number("shutter_open"),
                                           number("shutter_close")};
    std::vector<Plugin> all = {
        {"perspective", "<sensor type='perspective'>%s</sensor>", lens},
        {"thinlens", "<sensor type='thinlens'><float name='aperture_radius' value='0.1'/>%s</sensor>", lens},
        {"orthographic",
         "<sensor type='orthographic'>%s</sensor>",
         {kTransform, number("near_clip"), number("far_clip", "90"), number("shutter_open")}},
        film("hdrfilm", {integer("width"), integer("height"), integer("crop_offset_x"), integer("crop_offset_y"),
                         integer("crop_width"), integer("crop_height"), text("file_format", "rgbe"),
                         text("pixel_format", "luminance"), text("pixel_format", "rgba"), text("pixel_format", "xyz"),
                         text("component_format", "uint32"), flag("sample_border", "false"), "<rfilter type='box'/>"}),
        film("specfilm", {integer("width")}),
    };
    for (const char* type : {"stratified", "multijitter", "orthogonal", "ldsampler"})
        all.push_back({type,
                       in_film(std::string("<sampler type='") + type + "'>%s</sampler>"),
                       {integer("sample_count", "9"), integer("seed"), flag("jitter", "false"), integer("strength")}});
    all.push_back({"independent",
                   in_film("<sampler type='independent'>%s</sampler>"),
                   {integer("sample_count", "9"), integer("seed")}});
    for (const auto& [type, parameter] :
         {std::pair{"gaussian", "stddev"}, {"tent", "radius"}, {"mitchell", "b"}, {"lanczos", "lobes"}})
        all.push_back({type,
                       in_film(std::string("<film type='hdrfilm'><rfilter type='") + type + "'>%s</rfilter></film>"),
                       {type == std::string("lanczos") ? integer(parameter) : number(parameter)}});
    return all;
}

std::vector<Plugin> others() {
    std::vector<Plugin> all;
    for (const char* type : {"path", "ptracer", "volpath", "volpathmis", "prb", "prbvolpath"})
        all.push_back({type,
                       std::string("<integrator type='") + type + "'>%s</integrator>",
                       {integer("max_depth"), integer("rr_depth"), flag("hide_emitters"), integer("samples_per_pass"),
                        integer("block_size"), number("timeout")}});
    all.push_back(
        {"direct",
         "<integrator type='direct'>%s</integrator>",
         {integer("shading_samples"), integer("emitter_samples"), integer("bsdf_samples"), flag("hide_emitters")}});
    const auto texture = [](const std::string& xml) {
        return on_shape("<bsdf type='diffuse'><texture name='reflectance' " + xml + "</texture></bsdf>");
    };
    const std::string uv = "<transform name='to_uv'><scale x='2'/></transform>";
    all.push_back({"bitmap",
                   texture("type='bitmap'><string name='filename' value='e.png'/>%s"),
                   {text("filter_type", "nearest"), text("wrap_mode", "clamp"), flag("raw"), text("format", "float16"),
                    flag("accel"), uv}});
    all.push_back({"mesh_attribute",
                   "<shape type='ply'><string name='filename' value='m.ply'/><bsdf type='diffuse'><texture "
                   "name='reflectance' type='mesh_attribute'><string name='name' value='vertex_color'/>%s</texture>"
                   "</bsdf></shape>",
                   {number("scale"), integer("scale")}});
    all.push_back({"checkerboard", texture("type='checkerboard'>%s"), {color("color0"), color("color1"), uv}});
    return all;
}

Scene scene_of(const Plugin& plugin, const std::string& parameters, const TempFolder& folder) {
    std::string xml = plugin.xml;
    return load(xml.replace(xml.find("%s"), 2, parameters), {}, "3.0.0", &folder);
}

/// The scene of a plugin without further parameters, loaded once.
struct Plain {
    size_t notes;
    std::string contents;
};

/// "" or what became of a parameter that is neither used nor refused nor noted.
std::string unsaid(const Plugin& plugin, const std::string& parameter, std::optional<Plain>& plain,
                   const TempFolder& folder) {
    try {
        const Scene with = scene_of(plugin, parameter, folder);
        if (!with.warnings.empty() || has_note(with, std::string("'") + plugin.name + "'")) return "";
        if (!plain) {
            const Scene scene = scene_of(plugin, "", folder);
            plain = Plain{scene.notes.size(), contents(scene)};
        }
        const bool noted = with.notes.size() > plain->notes;
        return noted || contents(with) != plain->contents ? "" : std::string(plugin.name) + ": " + parameter;
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return "";
    }
}

}  // namespace

TEST_CASE("every parameter of Mitsuba's plugins is used, refused or noted") {
    const TempFolder folder;
    std::vector<uint8_t> bytes;
    for (int i = 0; i < 36; ++i) bytes.push_back(uint8_t(7 * i));
    write_byte_image(folder / "e.png", 4, 3, bytes);
    folder.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 .3\nf 1/1 2/2 3/1\nf 1/1 4/2 2/2\n");
    folder.write(
        "m.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty "
        "float u\nproperty float v\nproperty float r\nproperty float g\nproperty float b\nelement face 2\nproperty "
        "list uchar int vertex_indices\nend_header\n0 0 0 0 .3 .1 .2 .3\n1 0 0 0 0 .4 .4 .4\n0 1 0 1 0 .5 .2 .1\n0 0 1 "
        "0 1 .3 .3 .9\n3 0 1 2\n3 0 3 1\n");
    folder.write("c.txt", "0 0 0 .1\n1 0 0 .2\n1 1 0 .1\n2 1 1 .1\n");
    std::string grid = "VOL\3";
    const auto add = [&](const auto& value) { grid.append(reinterpret_cast<const char*>(&value), sizeof value); };
    for (const int32_t i : {1, 3, 3, 3, 1}) add(i);
    for (int i = 0; i < 6; ++i) add(float(i / 3));
    for (int i = 0; i < 27; ++i) add(i == 13 ? -1.0f : 1.0f + 0.1f * float(i % 5));
    folder.write("g.vol", grid);
    size_t tried = 0;
    for (const auto& plugins : {shapes(), bsdfs(), lights(), sensors(), others()})
        for (const Plugin& plugin : plugins) {
            std::optional<Plain> plain;
            for (const std::string& parameter : plugin.parameters) {
                CHECK(unsaid(plugin, parameter, plain, folder) == "");
                ++tried;
            }
        }
    CHECK(tried > 250);
}
