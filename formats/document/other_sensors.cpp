// Sensors that stand for others: a batch of them, and the one of a scene that has none.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/document/builder.h"
#include "formats/document/origin.h"

namespace ambilux::document {

void build_sensors(Builder& builder, const Object& first) {
    if (first.type != "batch") return build_sensor(builder, first);
    Reader in(builder, first);
    Object sensor, film = make_object("film", "hdrfilm", first.where);
    int64_t count = 0;
    while (const Object* inner = in.take("sensor"))
        if (count++ == 0) sensor = *inner;
    if (count == 0) in.fail("the batch has no sensor inside");
    builder.note(in.where(), "of a batch of sensors the first one is used, with its part of the batch's film");
    // Those of the sensor inside have no meaning.
    std::erase_if(sensor.children,
                  [](const Child& c) { return c.object->tag == "film" || c.object->tag == "sampler"; });
    set_integer(film, "width", 768);
    if (const Object* given = in.take("film")) film = *given;
    for (Value& v : film.values) {
        if (v.name != "width" || v.kind != ValueKind::integer) continue;
        if (std::fmod(v.number, double(count)) != 0)
            in.fail(fmt::format("the width of the film, {}, is no multiple of the {} sensors", v.number, count));
        v.number /= double(count);
    }
    add_child(sensor, film);
    if (const Object* sampler = in.take("sampler")) add_child(sensor, *sampler);
    in.finish();
    build_sensor(builder, sensor);
}

void build_default_sensor(Builder& builder, const Object& scene) {
    const Bounds3f box = surface_bounds(builder.scene);
    if (!(box.lower.x <= box.upper.x)) throw input_error(builder.scene.path, 0, "the scene has no sensor");
    // Scene::load() of Mitsuba 3.
    constexpr double kFov = 45;
    const auto& origin = builder.scene.origin;
    double extent = 0;
    for (int i = 0; i < 3; ++i) extent = std::max(extent, double(box.upper[i]) - box.lower[i]);
    const double distance = extent / (2 * std::tan(kFov * (M_PI / 360)));
    const auto center = [&](int i) { return 0.5 * (double(box.lower[i]) + box.upper[i]) + origin[size_t(i)]; };
    Object sensor = make_object("sensor", "perspective", scene.where);
    set_number(sensor, "fov", kFov);
    set_number(sensor, "near_clip", distance / 100);
    set_number(sensor, "far_clip", 5 * extent + distance);
    set_transform(sensor, "to_world", translation(center(0), center(1), double(box.lower.z) + origin[2] - distance));
    builder.note(scene.where, "the scene has no sensor; a perspective one with fov 45 looks at all of it along +z");
    build_sensor(builder, sensor);
}

}  // namespace ambilux::document
