#include <algorithm>
#include <cmath>

#include "formats/pbrt/environment.h"
#include "formats/pbrt/scene.h"
#include "formats/spot_falloff.h"

namespace ambilux::pbrt {

using namespace mitsuba;

namespace {

Vec3d point_of(const Matrix& m, Vec3d p) {
    const auto row = [&](int i) { return m.m[i][0] * p.x + m.m[i][1] * p.y + m.m[i][2] * p.z + m.m[i][3]; };
    return {row(0), row(1), row(2)};
}
Vec3d minus(Vec3d a, Vec3d b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

struct Emission {
    Rgb color;
    double scale;  ///< of the parameter and the film

    Rgb scaled(double factor = 1) const { return color * float(scale * factor); }
};

Emission emission(SceneMaker& scene, const Described& light, const char* name) {
    const Parameter* p = light.in.find(name);
    const double scale = light.in.number("scale", 1);
    if (!(scale >= 0)) fail(light.in.where_of("scale"), "the scale of a light must not be negative");
    return {p ? scene.spectra().color(*p, ColorUse::light, light.space) : splat(1), scale * scene.exposure};
}

/// Factor that gives the light the power of its parameter, over that of a light of 1.
double power_factor(const Described& light, const char* name, double of_one) {
    const double value = light.in.number(name, -1);
    return value > 0 ? value / of_one : 1;
}

void add_point(SceneMaker& scene, const Described& light) {
    Object& object = add_object(scene.document, "emitter", "point", light.in.where);
    const Vec3d p = point_of(scene.state.ctm, light.in.point("from", {0, 0, 0}));
    set_vector(object, "position", p);
    set_rgb(object, "intensity", emission(scene, light, "I").scaled(power_factor(light, "power", 4 * M_PI)));
    add_child(*scene.document.scene, object);
}

void add_distant(SceneMaker& scene, const Described& light) {
    Object& object = add_object(scene.document, "emitter", "directional", light.in.where);
    const Vec3d from = point_of(scene.state.ctm, light.in.point("from", {0, 0, 0})),
                to = point_of(scene.state.ctm, light.in.point("to", {0, 0, 1}));
    set_vector(object, "direction", minus(to, from));
    set_rgb(object, "irradiance", emission(scene, light, "L").scaled(power_factor(light, "illuminance", 1)));
    add_child(*scene.document.scene, object);
}

void add_spot(SceneMaker& scene, const Described& light) {
    const Parameters& in = light.in;
    Object& object = add_object(scene.document, "emitter", "spot", in.where);
    const Vec3d from = point_of(scene.state.ctm, in.point("from", {0, 0, 0})),
                to = point_of(scene.state.ctm, in.point("to", {0, 0, 1})), axis = minus(to, from);
    bool valid = true;
    const Vec3d up = std::fabs(axis.x) < 0.9 * length(axis) ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
    const Matrix to_world = look_at(from, to, up, valid);
    if (!valid) fail(in.where, "'from' and 'to' of a spot are one point");
    set_transform(object, "to_world", to_world);
    const double cone = in.number("coneangle", 30), delta = in.number("conedeltaangle", 5);
    if (!(cone > 0 && cone < 90)) fail(in.where_of("coneangle"), "coneangle must lie between 0 and 90 degrees");
    if (!(delta >= 0 && delta <= cone))
        fail(in.where_of("conedeltaangle"), "conedeltaangle must lie between 0 and coneangle");
    const double outer = cone * (M_PI / 180), inner = (cone - delta) * (M_PI / 180);
    set_number(object, "cutoff_angle", cone);
    set_number(object, "beam_width", cone);
    const double of_one = 2 * M_PI * ((1 - std::cos(inner)) + (std::cos(inner) - std::cos(outer)) / 2);
    set_rgb(object, "intensity", emission(scene, light, "I").scaled(power_factor(light, "power", of_one)));
    if (delta > 0) {
        scene.report.note(in.where, kSpotNote);
        add_spot_falloff(scene.document, object, outer, inner, [](double t) { return t * t * (3 - 2 * t); });
    }
    add_child(*scene.document.scene, object);
}

/// Rotation of the world's transform; a uniform scale is nothing to what is infinitely far away.
Matrix rotation_part(Matrix m) {
    const double scale = std::cbrt(std::fabs(determinant(m)));
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) m.m[i][j] /= scale > 0 ? scale : 1;
        m.m[i][3] = 0;
    }
    return m;
}

void add_infinite(SceneMaker& scene, const Described& light) {
    const Parameters& in = light.in;
    if (in.find("portal")) scene.report.refuse(in.where_of("portal"), "portals are not supported", "it is left out");
    const std::string name = in.text("filename", "");
    const Emission e = emission(scene, light, "L");
    if (name.empty()) {
        Object& object = add_object(scene.document, "emitter", "constant", in.where);
        set_rgb(object, "radiance", e.scaled(power_factor(light, "illuminance", M_PI)));
        return add_child(*scene.document.scene, object);
    }
    if (in.find("L")) fail(in.where_of("L"), "both 'L' and 'filename' are given");
    const std::string path = resolve(scene.folder, name, in.where_of("filename"));
    const Environment environment = read_environment(scene.document, path, in.where);
    scene.report.note(in.where,
                      "environment maps are resampled from the equal-area octahedron to latitude and "
                      "longitude, which blurs them by half a texel");
    Object& object = add_object(scene.document, "emitter", "envmap", in.where);
    set_text(object, "image", environment.image);
    set_number(object, "scale", e.scale * power_factor(light, "illuminance", environment.illuminance));
    set_transform(object, "to_world", rotation_part(scene.state.ctm));
    add_child(*scene.document.scene, object);
}

}  // namespace

void add_light(SceneMaker& scene, const Described& light) {
    const std::string& type = light.in.type;
    if (type == "point")
        add_point(scene, light);
    else if (type == "spot")
        add_spot(scene, light);
    else if (type == "distant")
        add_distant(scene, light);
    else if (type == "infinite")
        add_infinite(scene, light);
    else
        return scene.report.refuse(light.in.where, "light '" + type + "' is not supported", "it is left out");
    light.in.finish(scene.report);
}

const Object& area_emitter(SceneMaker& scene, const Described& light, const UvMap& uv, double area) {
    const Parameters& in = light.in;
    if (in.type != "diffuse") fail(in.where, "area light '" + in.type + "' is not known: diffuse is");
    if (in.boolean("twosided", false))
        scene.report.refuse(in.where_of("twosided"), "area lights of two sides are not supported", "it has one");
    Object& object = add_object(scene.document, "emitter", "area", in.where);
    const Emission e = emission(scene, light, "L");
    const std::string name = in.text("filename", "");
    const bool has_power = in.number("power", -1) > 0;
    if (has_power && (area == 0 || !name.empty()))
        scene.report.refuse(in.where_of("power"),
                            "the power of a light of unequal triangles, of a mesh file or of an image is not supported",
                            "it is left out");
    const double factor = area > 0 && name.empty() ? power_factor(light, "power", M_PI * area) : 1;
    if (name.empty()) {
        set_rgb(object, "radiance", e.scaled(factor));
    } else {
        if (in.find("L")) fail(in.where_of("L"), "both 'L' and 'filename' are given");
        Texture texture;
        texture.kind = Texture::Kind::image;
        texture.where = in.where;
        texture.wrap = "clamp";
        texture.color = e.scaled();
        texture.image = std::make_shared<TextureImage>();
        texture.image->path = resolve(scene.folder, name, in.where_of("filename"));
        add_child(object, scene.textures.object(texture, uv), "radiance");
    }
    in.finish(scene.report);
    return object;
}

}  // namespace ambilux::pbrt
