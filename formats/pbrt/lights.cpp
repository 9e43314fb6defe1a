#include <algorithm>
#include <cmath>

#include "formats/pbrt/environment.h"
#include "formats/pbrt/light_parameters.h"
#include "formats/pbrt/names.h"
#include "formats/spot_falloff.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

void add_point(SceneMaker& scene, const Described& light) {
    Object& object = add_to_scene(scene.document, "emitter", "point", light.in.where);
    const Vec3d p = transformed(scene.state.ctm, light.in.point("from", {0, 0, 0}));
    set_vector(object, "position", p);
    set_rgb(object, "intensity", emission(scene, light, "I").scaled(power_factor(light, "power", 4 * M_PI)));
}

void add_distant(SceneMaker& scene, const Described& light) {
    Object& object = add_to_scene(scene.document, "emitter", "directional", light.in.where);
    const Vec3d from = transformed(scene.state.ctm, light.in.point("from", {0, 0, 0})),
                to = transformed(scene.state.ctm, light.in.point("to", {0, 0, 1}));
    set_vector(object, "direction", to - from);
    set_rgb(object, "irradiance", emission(scene, light, "L").scaled(power_factor(light, "illuminance", 1)));
}

void add_spot(SceneMaker& scene, const Described& light) {
    const Parameters& in = light.in;
    Object& object = add_to_scene(scene.document, "emitter", "spot", in.where);
    const Vec3d from = transformed(scene.state.ctm, in.point("from", {0, 0, 0})),
                to = transformed(scene.state.ctm, in.point("to", {0, 0, 1})), axis = to - from;
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
}

/// Several infinite lights are one: a constant light on top of the one there is.
void add_to_environment(SceneMaker& scene, Rgb radiance) {
    Object& object = *scene.environment;
    const auto value = [&](const char* name) -> Value& {
        return *std::find_if(object.values.begin(), object.values.end(),
                             [&](const Value& v) { return v.name == name; });
    };
    if (object.type == "constant") {
        value("radiance").rgb += radiance;
        return;
    }
    const double scale = value("scale").number;
    Value& image = value("image");
    Texels texels = scene.document.images[image.text];
    if (scale > 0) {
        for (size_t i = 0; i < texels.floats.size(); ++i)
            if (i % 4 < 3) texels.floats[i] += radiance[int(i % 4)] / float(scale);
    } else {
        value("scale").number = 1;
        for (size_t i = 0; i < texels.floats.size(); ++i) texels.floats[i] = i % 4 < 3 ? radiance[int(i % 4)] : 1.0f;
    }
    image.text += "+";
    scene.document.images[image.text] = std::move(texels);
}

/// True if the environment is that map already.
bool is_the_same_map(const SceneMaker& scene, const std::string& image, double scale, const Matrix& to_world) {
    if (!scene.environment || scene.environment->type != "envmap") return false;
    const Object& known = *scene.environment;
    return known.find("image")->text == image && known.find("scale")->number == scale &&
           known.find("to_world")->transform == to_world;
}

void add_infinite(SceneMaker& scene, const Described& light) {
    const Parameters& in = light.in;
    if (in.find("portal"))
        scene.report.note(in.where_of("portal"),
                          "portals are ignored: light that does not pass them counts too, which makes no difference "
                          "where walls enclose the rest");
    const std::string name = in.text("filename", "");
    const Emission e = emission(scene, light, "L");
    if (name.empty()) {
        const Rgb radiance = e.scaled(power_factor(light, "illuminance", M_PI));
        if (scene.environment) return add_to_environment(scene, radiance);
        scene.environment = &add_to_scene(scene.document, "emitter", "constant", in.where);
        return set_rgb(*scene.environment, "radiance", radiance);
    }
    if (in.find("L")) fail(in.where_of("L"), "both 'L' and 'filename' are given");
    const std::string path = resolve(scene.folder, name, in.where_of("filename"));
    const Environment environment = read_environment(scene.document, path, in.where);
    scene.report.note(in.where,
                      "environment maps are resampled from the equal-area octahedron to latitude and "
                      "longitude, which blurs them by half a texel");
    const double scale = e.scale * power_factor(light, "illuminance", environment.illuminance);
    const Matrix turned = rotation_of(scene.state.ctm);
    if (in.find("portal") && is_the_same_map(scene, environment.image, scale, turned)) {
        return scene.report.note(in.where, "portals that look at one map share its light");
    }
    Rgb more{};
    if (scene.environment) {  // a constant one joins the map
        if (scene.environment->type != "constant") fail(in.where, "two infinite lights with images are not supported");
        more = scene.environment->find("radiance")->rgb;
        scene.environment->type = "envmap";
        scene.environment->values.clear();
    } else {
        scene.environment = &add_to_scene(scene.document, "emitter", "envmap", in.where);
    }
    Object& object = *scene.environment;
    set_text(object, "image", environment.image);
    set_number(object, "scale", scale);
    set_transform(object, "to_world", turned);
    if (!is_zero(more)) add_to_environment(scene, more);
}

/// A checkerboard as an image, whose texels may be any numbers.
Texture cells(const Texture& checkerboard) {
    Texture out = checkerboard;
    out.kind = Texture::Kind::image;
    out.filter = "nearest";
    out.mapping = UvMap{{{0.5, 0, 0}, {0, 0.5, 0}}} * checkerboard.mapping;
    out.color = splat(1);
    out.image = made_image(2, 2);
    const Rgb even = checkerboard.color, odd = checkerboard.odd;
    out.image->texels = {odd, even, even, odd};
    return out;
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
    else if (type == "projection")
        add_projection(scene, light);
    else if (type == "goniometric")
        add_goniometric(scene, light);
    else
        return scene.report.refuse(light.in.where, not_supported("light", type), "it is left out");
    light.in.finish(scene.report);
}

const Object& area_emitter(SceneMaker& scene, const Described& light, const UvMap& uv, double area, bool hidden,
                           const Texture& alpha) {
    const Parameters& in = light.in;
    if (in.type != "diffuse") fail(in.where, "area light '" + in.type + "' is not known: diffuse is");
    if (in.boolean("twosided", false)) area *= 2;
    Object& object = add_object(scene.document, "emitter", hidden ? "hiddenarea" : "area", in.where);
    const Emission e = emission(scene, light, "L");
    const std::string name = in.text("filename", "");
    const bool has_power = in.number("power", -1) > 0;
    if (has_power && (area == 0 || !name.empty()))
        scene.report.refuse(in.where_of("power"),
                            "the power of a light of unequal triangles, of a mesh file or of an image is not supported",
                            "it is left out");
    const double factor = area > 0 && name.empty() ? power_factor(light, "power", M_PI * area) : 1;
    const bool masked = !alpha.is_constant() && name.empty() && alpha.kind != Texture::Kind::solid;
    const Rgb radiance =
        e.scaled(factor) * (alpha.is_constant() ? min(max(alpha.color, splat(0)), splat(1)) : splat(1));
    if (!alpha.is_constant() && !masked)
        scene.report.note(in.where,
                          "a light with an image, or with a solid texture as alpha, also emits where alpha is 0");
    if (masked) {
        Texture texture = alpha;
        if (alpha.kind == Texture::Kind::checkerboard) texture = cells(alpha);
        texture.color *= radiance;
        add_child(object, scene.textures.object(texture, uv, [](Rgb c) { return c; }), "radiance");
    } else if (name.empty()) {
        set_rgb(object, "radiance", radiance);
    } else {
        if (in.find("L")) fail(in.where_of("L"), "both 'L' and 'filename' are given");
        Texture texture = texture_of_file(resolve(scene.folder, name, in.where_of("filename")), in.where);
        texture.wrap = "clamp";
        texture.color = radiance;
        add_child(object, scene.textures.object(texture, uv), "radiance");
    }
    in.finish(scene.report);
    return object;
}

}  // namespace ambilux::pbrt
