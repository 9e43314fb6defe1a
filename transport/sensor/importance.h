// The camera as an emitter of importance, for light tracing and bidirectional connections.
//
// One normalisation throughout (PBRT 4th ed. section 16.1.1 divides by the area of the film, we by that of one pixel):
// film positions have density 1 per pixel. So We integrates to 1 over the directions (and the lens) of each pixel, and
// the value of pixel j is
//   I_j = ∫ filter(film - centre_j) We L cos dA dw,
// whatever the size of film and crop. Along every camera ray We cos = pdf_position · pdf_direction: radiance counts
// with weight 1.
#pragma once

#include "transport/sensor/camera.h"

namespace ambilux {

/// The camera's position is one point (pinhole): no light path meets it by chance.
AMBILUX_HD bool camera_delta_position(const Sensor& sensor) {
    return !is_parallel(sensor.type) && (!has_lens(sensor.type) || !(sensor.aperture_radius > 0.0f));
}
/// All rays are parallel.
AMBILUX_HD bool camera_delta_direction(const Sensor& sensor) { return is_parallel(sensor.type); }

/// Area of one pixel on the plane z = 1 of camera space, or (orthographic) in world units. Not of spherical ones.
AMBILUX_HD float camera_pixel_area(const Sensor& sensor) {
    const float area =
        4.0f * sensor.tan_half_fov.x * sensor.tan_half_fov.y / (float(sensor.film_width) * float(sensor.film_height));
    if (!is_parallel(sensor.type)) return area;
    return area * length(cross(sensor.to_world.vector({1, 0, 0}), sensor.to_world.vector({0, 1, 0})));
}

/// Density of the ray's start per area (lens; orthographic: sensor plane, at density 1 per pixel); 1 for a pinhole.
AMBILUX_HD float camera_pdf_position(const Sensor& sensor) {
    if (camera_delta_position(sensor)) return 1.0f;
    if (is_parallel(sensor.type)) return 1.0f / camera_pixel_area(sensor);
    return 1.0f / (kPi * sqr(sensor.aperture_radius));
}

/// Density of the ray's direction per solid angle, given the lens point, at density 1 per pixel; 1 for parallel rays.
/// `cos_camera`: camera_cosine of the direction. A pixel covers A cos³ of solid angle, for the pinhole and for any
/// point of a thin lens alike.
template <Features F>
AMBILUX_HD float camera_pdf_direction_sa(const Sensor& sensor, float cos_camera) {
    if (camera_delta_direction(sensor)) return 1.0f;
    if constexpr (F.latlong)
        if (is_latlong(sensor.type)) return latlong_pdf_sa(sensor, cos_camera);
    if (!(cos_camera > 0.0f)) return 0.0f;
    return 1.0f / (camera_pixel_area(sensor) * cos_camera * cos_camera * cos_camera);
}

/// Importance We of a ray whose camera_cosine is `cos_camera`.
template <Features F>
AMBILUX_HD float camera_importance(const Sensor& sensor, float cos_camera) {
    if (!(cos_camera > 0.0f)) return 0.0f;
    if constexpr (F.latlong)
        if (is_latlong(sensor.type)) return latlong_pdf_sa(sensor, cos_camera);  // all directions leave a point
    const float cos_position = camera_delta_direction(sensor) ? 1.0f : cos_camera;
    return camera_pdf_position(sensor) * camera_pdf_direction_sa<F>(sensor, cos_camera) / cos_position;
}

/// World vector in camera space. The columns of to_world are orthogonal; they may be scaled.
AMBILUX_HD Vec3f world_to_camera_vector(const Sensor& sensor, Vec3f v) {
    const Vec3f x = sensor.to_world.vector({1, 0, 0}), y = sensor.to_world.vector({0, 1, 0}),
                z = sensor.to_world.vector({0, 0, 1});
    return {dot(v, x) / length_squared(x), dot(v, y) / length_squared(y), dot(v, z) / length_squared(z)};
}

/// What the density of the direction `d`, unit, depends on: its cosine to the view axis; of a spherical sensor the sine
/// of the angle to its poles.
template <Features F>
AMBILUX_HD float camera_cosine(const Sensor& sensor, Vec3f d) {
    if constexpr (F.latlong)
        if (is_latlong(sensor.type)) return latlong_sine(world_to_camera_vector(sensor, d));
    const Vec3f axis = sensor.to_world.vector({0.0f, 0.0f, 1.0f});
    return dot(d, axis) / length(axis);
}

/// Film position at which point `p` is seen through lens point `lens` (camera space; see lens_point). False in front of
/// the near plane and behind the far plane. The position may lie outside of the film: what counts is which pixels'
/// filters reach it.
template <Features F>
AMBILUX_HD bool project_to_film(const Sensor& sensor, Vec3f p, Vec2f lens, Vec2f& film_position) {
    const Vec3f origin = {sensor.to_world.m[0][3], sensor.to_world.m[1][3], sensor.to_world.m[2][3]};
    const Vec3f c = world_to_camera_vector(sensor, p - origin);
    if constexpr (F.latlong)
        if (is_latlong(sensor.type)) {
            film_position = latlong_film(sensor, c);
            return latlong_sine(c) > 0.0f;
        }
    if (!(c.z >= sensor.near_clip && c.z <= sensor.far_clip)) return false;
    if (is_parallel(sensor.type)) {
        film_position = camera_to_film(sensor, {c.x, c.y});
        return true;
    }
    if (!(c.z > 0.0f)) return false;
    const float focus = has_lens(sensor.type) ? sensor.focus_distance : 1.0f;
    const Vec2f slope = {(c.x - lens.x) / c.z, (c.y - lens.y) / c.z};
    film_position = camera_to_film(sensor, {slope.x + lens.x / focus, slope.y + lens.y / focus});
    return true;
}

/// Light from a scene point to the camera (the t = 1 strategy).
struct CameraConnection {
    Vec3f wi;               ///< unit, from the reference to the camera
    float distance;         ///< along wi to the near plane: what lies beyond does not hide the reference
    float camera_distance;  ///< along wi to the lens (orthographic: sensor plane z = 0)
    Vec2f film_position;    ///< pixels of the full film, perhaps outside
    float cos_camera;       ///< camera_cosine of the ray
    float weight;  ///< We cos_camera / (distance² pdf_lens) (orthographic: We; spherical: We / distance²): times
                   ///< flux · f · |cos at the reference| = a splat's value
};

/// Connects `reference_p` with the camera, for a thin lens with the point of `lens_u`. False where the camera cannot
/// see it.
template <Features F>
AMBILUX_HD bool connect_to_camera(const Sensor& sensor, Vec3f reference_p, Vec2f lens_u, CameraConnection& c) {
    const Vec2f lens = lens_point(sensor, lens_u);
    if (!project_to_film<F>(sensor, reference_p, lens, c.film_position)) return false;
    if (is_parallel(sensor.type)) {
        const Vec3f axis = sensor.to_world.vector({0, 0, 1});
        const float scale = length(axis);
        c.wi = axis * (-1.0f / scale);
        const Vec3f origin = {sensor.to_world.m[0][3], sensor.to_world.m[1][3], sensor.to_world.m[2][3]};
        c.camera_distance = -dot(reference_p - origin, c.wi);
        c.distance = c.camera_distance - sensor.near_clip * scale;
        c.cos_camera = 1.0f;
        c.weight = camera_importance<F>(sensor, 1.0f);
        return true;
    }
    const Vec3f to_camera = sensor.to_world.point({lens.x, lens.y, 0.0f}) - reference_p;
    const float d2 = length_squared(to_camera);
    if (!(d2 > 0.0f)) return false;
    c.camera_distance = sqrtf(d2);
    c.wi = to_camera * (1.0f / c.camera_distance);
    if constexpr (F.latlong)
        if (is_latlong(sensor.type)) {
            c.distance = c.camera_distance;
            c.cos_camera = camera_cosine<F>(sensor, -c.wi);
            c.weight = camera_importance<F>(sensor, c.cos_camera) / d2;
            return true;
        }
    c.cos_camera = -dot(c.wi, normalize(sensor.to_world.vector({0, 0, 1})));
    if (!(c.cos_camera > 0.0f)) return false;
    const float axis_scale = length(sensor.to_world.vector({0, 0, 1}));
    c.distance = c.camera_distance - sensor.near_clip * axis_scale / c.cos_camera;
    c.weight = camera_importance<F>(sensor, c.cos_camera) * c.cos_camera / (d2 * camera_pdf_position(sensor));
    return true;
}

}  // namespace ambilux
