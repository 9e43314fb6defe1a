// Camera rays of all sensors (Mitsuba's models).
//
// Film positions are in pixels of the full film, origin at the top left, x to the right, y down. Camera space: +z is
// the view direction, +y up, +x left in the image. A film position shifted by principal_offset·size sees what the
// centred camera would see there.
#pragma once

#include "core/sampling.h"
#include "scene/view.h"
#include "transport/sensor/latlong.h"

namespace ambilux {

/// Ray from the camera: `o` lies on the near plane, `d` is unit, and the ray ends at the far plane, `tmax` from `o`
/// (spherical: it begins at the camera and has no end).
/// Its radiance counts with weight 1 for a film position sampled by sample_film_position and a lens position uniform
/// over the aperture.
struct CameraSample {
    Vec3f o, d;
    float tmax;
};

/// Film position to the plane z = 1 of camera space (perspective, thin lens), or to camera units (orthographic).
AMBILUX_HD Vec2f film_to_camera(const Sensor& sensor, Vec2f film_position) {
    const float x = film_position.x / float(sensor.film_width) + sensor.principal_offset.x;
    const float y = film_position.y / float(sensor.film_height) + sensor.principal_offset.y;
    return {(1.0f - 2.0f * x) * sensor.tan_half_fov.x, (1.0f - 2.0f * y) * sensor.tan_half_fov.y};
}

/// Inverse of film_to_camera.
AMBILUX_HD Vec2f camera_to_film(const Sensor& sensor, Vec2f c) {
    const float x = 0.5f - 0.5f * c.x / sensor.tan_half_fov.x - sensor.principal_offset.x;
    const float y = 0.5f - 0.5f * c.y / sensor.tan_half_fov.y - sensor.principal_offset.y;
    return {x * float(sensor.film_width), y * float(sensor.film_height)};
}

/// Point of the lens in camera space for `lens_u` in [0,1)²; the origin where there is no lens.
AMBILUX_HD Vec2f lens_point(const Sensor& sensor, Vec2f lens_u) {
    if (!has_lens(sensor.type)) return {0.0f, 0.0f};
    return square_to_disk(lens_u) * sensor.aperture_radius;
}

/// Ray through `film_position`, for a thin lens through the lens point of `lens_u`. The clip distances count along the
/// view axis.
template <Features F>
AMBILUX_HD CameraSample sample_camera_ray(const Sensor& sensor, Vec2f film_position, Vec2f lens_u) {
    if constexpr (F.latlong)
        if (is_latlong(sensor.type))
            return {sensor.to_world.point({0.0f, 0.0f, 0.0f}),
                    normalize(sensor.to_world.vector(latlong_direction(sensor, film_position))), kInfinity};
    const Vec2f c = film_to_camera(sensor, film_position);
    if (is_parallel(sensor.type))
        return {sensor.to_world.point({c.x, c.y, sensor.near_clip}),
                normalize(sensor.to_world.vector({0.0f, 0.0f, 1.0f})),
                (sensor.far_clip - sensor.near_clip) * length(sensor.to_world.vector({0.0f, 0.0f, 1.0f}))};
    const Vec2f lens = lens_point(sensor, lens_u);
    const float focus = has_lens(sensor.type) ? sensor.focus_distance : 1.0f;
    // (dx,dy,1) leads from the lens point to the point in focus.
    const Vec3f local = {c.x - lens.x / focus, c.y - lens.y / focus, 1.0f};
    const Vec3f o = {lens.x + local.x * sensor.near_clip, lens.y + local.y * sensor.near_clip, sensor.near_clip};
    const Vec3f direction = sensor.to_world.vector(local);
    const float l = length(direction);
    return {sensor.to_world.point(o), direction * (1.0f / l), (sensor.far_clip - sensor.near_clip) * l};
}

}  // namespace ambilux
