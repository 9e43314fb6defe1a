// Lights and cameras.
#include <algorithm>
#include <cmath>

#include "formats/gltf/model.h"
#include "formats/spot_falloff.h"

namespace ambilux::gltf {

using namespace document;

namespace {

constexpr int64_t kHeight = 720;  // of the image, which glTF does not tell
constexpr double kFov = 40;       // of the default camera, degrees
constexpr double kWidestSpot = 89.9 * (M_PI / 180);

/// Mitsuba's cameras and spots look along +z with x to the left, glTF's along -z with x to the right.
Matrix turned(Matrix m) {
    for (int j = 0; j < 3; ++j) {
        const double l = length(column(m, j));
        for (int i = 0; i < 3; ++i) m.m[i][j] /= l > 0 ? l : 1;
    }
    return m * scaling(-1, 1, -1);
}

Object& sensor(Context& context, const char* type, const Matrix& to_world, double aspect) {
    Object& film = add_object(context.document, "film", "hdrfilm", context.where);
    set_integer(film, "width", std::clamp<int64_t>(std::llround(aspect * kHeight), 1, 65536));
    set_integer(film, "height", kHeight);
    Object& out = add_object(context.document, "sensor", type, context.where);
    set_transform(out, "to_world", to_world);
    add_child(out, film);
    return out;
}

void set_clips(Object& sensor, double near, double far) {
    set_number(sensor, "near_clip", near > 0 ? near : 1e-5);
    set_number(sensor, "far_clip", far > near && far > 0 ? far : 1e10);
}

}  // namespace

void add_light(Context& context, const tinygltf::Light& light, const Matrix& to_world) {
    const Rgb color =
        light.color.size() < 3 ? splat(1) : Rgb{float(light.color[0]), float(light.color[1]), float(light.color[2])};
    const Rgb value = color * float(light.intensity);
    if (value == splat(0)) return context.note("lights of intensity 0 are left out");
    context.emits = true;
    if (light.range > 0)
        context.note("the range of lights is ignored: their light falls off with the squared distance");
    Object& out = add_to_scene(context.document, "emitter", light.type, context.where);
    if (light.type == "directional") {
        set_vector(out, "direction", column(to_world, 2) * -1);
        return set_rgb(out, "irradiance", value);
    }
    if (light.type == "point") {
        set_vector(out, "position", column(to_world, 3));
        return set_rgb(out, "intensity", value);
    }
    if (light.type != "spot") context.fail("light '" + light.name + "' is of the unknown type '" + light.type + "'");
    double outer = light.spot.outerConeAngle, inner = light.spot.innerConeAngle;
    if (!(inner >= 0 && inner <= outer && outer <= M_PI / 2 + 1e-4))
        context.fail("the cone of light '" + light.name + "' must be pi/2 at most and hold its inner cone");
    if (outer > kWidestSpot) {
        context.note("spots of a half-space are a tenth of a degree narrower");
        outer = kWidestSpot, inner = std::min(inner, outer);
    }
    set_transform(out, "to_world", turned(to_world));
    set_number(out, "cutoff_angle", outer * (180 / M_PI));
    set_number(out, "beam_width", outer * (180 / M_PI));
    set_rgb(out, "intensity", value);
    if (inner < outer) {
        context.note(kSpotNote);
        add_spot_falloff(context.document, out, outer, inner, [](double t) { return t * t; });
    }
}

Object& add_camera(Context& context, const tinygltf::Camera& camera, Matrix to_world) {
    to_world = turned(to_world);
    if (camera.type == "orthographic") {
        const auto& o = camera.orthographic;
        if (!(o.xmag != 0 && o.ymag != 0))
            context.fail("camera '" + camera.name + "' sees nothing: a magnification of 0");
        Object& out = sensor(context, "orthographic", to_world * scaling(std::fabs(o.xmag), std::fabs(o.xmag), 1),
                             std::fabs(o.xmag / o.ymag));
        set_clips(out, o.znear, o.zfar);
        return out;
    }
    const auto& p = camera.perspective;
    if (!(p.yfov > 0 && p.yfov < M_PI)) context.fail("yfov of camera '" + camera.name + "' must lie between 0 and pi");
    Object& out = sensor(context, "perspective", to_world, p.aspectRatio > 0 ? p.aspectRatio : 16.0 / 9);
    set_number(out, "fov", p.yfov * (180 / M_PI));
    set_text(out, "fov_axis", "y");
    set_clips(out, p.znear, p.zfar);
    return out;
}

Object& add_default_camera(Context& context, Vec3f lower, Vec3f upper) {
    const Vec3f c = (lower + upper) * 0.5f, half = (upper - lower) * 0.5f;
    const double radius = std::max(double(length(half)), 1e-6);
    const bool lies = half.y < 1e-3f * radius;  // and is a line to those who look along it
    context.note(lies ? "the file has no camera: one that looks down at all of it by 45 degrees is used"
                      : "the file has no camera: one that looks along -z at all of it is used");
    const Matrix tilt = lies ? rotation(1, 0, 0, -45) : Matrix{};
    Object& out = sensor(context, "perspective",
                         translation(c.x, c.y, c.z) * tilt * translation(0, 0, radius / std::sin(kFov * (M_PI / 360))) *
                             scaling(-1, 1, -1),
                         16.0 / 9);
    set_number(out, "fov", kFov);
    set_text(out, "fov_axis", "y");
    set_clips(out, radius * 1e-3, radius * 1e3);
    return out;
}

}  // namespace ambilux::gltf
