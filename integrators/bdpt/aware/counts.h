// How many light vertices eye vertices draw, by pixel.
#pragma once

#include <cstdint>

#include "transport/sensor/importance.h"

namespace ambilux {

/// Counts of blocks of pixels. A path has that of the pixel in which its film position lies, whichever pixels its
/// filter reaches: so all strategies of a path agree on it.
struct PixelCounts {
    const uint16_t* of_block;  ///< row by row
    uint32_t x, y;             ///< blocks along the sides of the film

    /// Of a place on the film; beyond its edges that of the nearest pixel.
    AMBILUX_HD uint32_t at(const Sensor& s, Vec2f film) const {
        return of_block[block(film.y - float(s.crop_y), s.crop_height, y) * x +
                        block(film.x - float(s.crop_x), s.crop_width, x)];
    }
    AMBILUX_HD static uint32_t block(float place, uint32_t pixels, uint32_t blocks) {
        const float last = float(pixels - 1), pixel = fminf(fmaxf(floorf(place), 0.0f), last);
        return uint32_t((uint64_t(pixel) * 2 + 1) * blocks / (uint64_t(pixels) * 2));
    }
};

/// Where on the film the point `p` is seen by the eye subpath whose first ray meets it.
template <Features F, class Path>
AMBILUX_HD Vec2f film_position(const Sensor& sensor, const Path& path, Vec3f p) {
    Vec2f lens = {0.0f, 0.0f}, film = {0.0f, 0.0f};
    if (has_lens(sensor.type)) {
        const Vec3f origin = {sensor.to_world.m[0][3], sensor.to_world.m[1][3], sensor.to_world.m[2][3]};
        const Vec3f c =
            world_to_camera_vector(sensor, path.origin - path.direction * path.start.camera_distance - origin);
        lens = {c.x, c.y};
    }
    project_to_film<F>(sensor, p, lens, film);
    return film;
}

}  // namespace ambilux
