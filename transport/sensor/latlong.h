// The film of all directions (plugin `spherical` of Mitsuba 0.6, src/sensors/spherical.cpp): x is the longitude, y the
// angle to +y of camera space. Its middle looks along +z. Rays start in one point and are not clipped.
//
// The film has no edges: right of it is its left side, and above and below, beyond the poles, the other half of the
// world, upside down. Filters reach there, so that a direction is seen at several places.
#pragma once

#include "core/sampling.h"
#include "scene/view.h"

namespace ambilux {

/// Unit direction in camera space that is seen at `film`.
AMBILUX_HD Vec3f latlong_direction(const Sensor& sensor, Vec2f film) {
    const float longitude = film.x / float(sensor.film_width), angle = 0.5f * film.y / float(sensor.film_height);
    float sine, cosine, sine_to_pole, cosine_to_pole;
    sin_cos_turns(longitude - floorf(longitude), sine, cosine);
    sin_cos_turns(angle - floorf(angle), sine_to_pole, cosine_to_pole);
    return {sine * sine_to_pole, cosine_to_pole, -cosine * sine_to_pole};
}

/// Sine of the angle between unit `d` of camera space and the poles.
AMBILUX_HD float latlong_sine(Vec3f d) { return sqrtf(d.x * d.x + d.z * d.z); }

/// Where the direction `d` of camera space, of any length, is seen: in [0,width] x [0,height].
AMBILUX_HD Vec2f latlong_film(const Sensor& sensor, Vec3f d) {
    const float turn = atan2f(d.x, -d.z) * (0.5f * kInvPi), angle = atan2f(latlong_sine(d), d.y);
    return {(turn < 0.0f ? turn + 1.0f : turn) * float(sensor.film_width),
            angle * (kInvPi * float(sensor.film_height))};
}

/// Density of directions per solid angle at density 1 per pixel: a pixel covers 2 pi/width times pi/height times the
/// sine. Infinite at the poles.
AMBILUX_HD float latlong_pdf_sa(const Sensor& sensor, float sine) {
    return float(sensor.film_width) * float(sensor.film_height) / (2.0f * kPi * kPi * sine);
}

/// op(place) for every place within reach of the filters of pixels, on the film or beyond its edges, where that is seen
/// which is seen at `film`.
template <Features F, class Op>
AMBILUX_HD void for_each_film_position(const Sensor& sensor, Vec2f film, Op op) {
    if constexpr (F.latlong) {
        if (is_latlong(sensor.type)) {
            const float w = float(sensor.film_width), h = float(sensor.film_height), beyond = sensor.filter_radius;
            for (uint32_t over_pole = 0; over_pole < 2; ++over_pole) {
                const float x = over_pole ? film.x + 0.5f * w : film.x, y = over_pole ? -film.y : film.y;
                const float first_x = x + w * ceilf((-beyond - x) / w);
                const float first_y = y + 2.0f * h * ceilf((-beyond - y) / (2.0f * h));
                for (float at_y = first_y; at_y <= h + beyond; at_y += 2.0f * h)
                    for (float at_x = first_x; at_x <= w + beyond; at_x += w) op(Vec2f{at_x, at_y});
            }
            return;
        }
    }
    op(film);
}

}  // namespace ambilux
