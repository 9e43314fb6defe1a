#include "view/camera.h"

#include <algorithm>

#include "core/error.h"

namespace ambilux {
namespace {

Vec3f column(const Affine& a, int i) { return {a.m[0][i], a.m[1][i], a.m[2][i]}; }

}  // namespace

LookAt look_of(const Sensor& sensor, Vec3f bounds_center, float bounds_radius) {
    const Vec3f origin = column(sensor.to_world, 3), along = normalize(column(sensor.to_world, 2));
    float distance = dot(bounds_center - origin, along);
    if (!(distance > 0.05f * bounds_radius)) distance = bounds_radius > 0.0f ? bounds_radius : 1.0f;
    return {origin, origin + along * distance, normalize(column(sensor.to_world, 1))};
}

Sensor placed(const Sensor& sensor, const LookAt& look) {
    const Vec3f along = look.target - look.origin, left = cross(look.up, along);
    if (!is_finite(look.origin) || !is_finite(along) || !is_finite(left) || !(length(along) > 0.0f) ||
        !(length(left) > 0.0f))
        throw Error(ExitCode::usage, "camera: origin, target and up do not make one");
    const Vec3f z = normalize(along), x = normalize(left), axes[] = {x, cross(z, x), z};
    Sensor out = sensor;
    for (int i = 0; i < 3; ++i) {
        // An orthographic sensor is as wide as its matrix says.
        const Vec3f axis = axes[i] * length(column(sensor.to_world, i));
        out.to_world.m[0][i] = axis.x;
        out.to_world.m[1][i] = axis.y;
        out.to_world.m[2][i] = axis.z;
    }
    out.to_world.m[0][3] = look.origin.x;
    out.to_world.m[1][3] = look.origin.y;
    out.to_world.m[2][3] = look.origin.z;
    return out;
}

Sensor smaller(const Sensor& sensor, uint32_t divisor) {
    Sensor out = sensor;
    for (uint32_t* n : {&out.film_width, &out.film_height, &out.crop_width, &out.crop_height})
        *n = std::max(1u, *n / divisor);
    out.crop_x = std::min(sensor.crop_x / divisor, out.film_width - 1);
    out.crop_y = std::min(sensor.crop_y / divisor, out.film_height - 1);
    out.crop_width = std::min(out.crop_width, out.film_width - out.crop_x);
    out.crop_height = std::min(out.crop_height, out.film_height - out.crop_y);
    return out;
}

}  // namespace ambilux
