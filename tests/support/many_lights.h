// Scenes with lamps of all kinds, for tests of how lights are picked.
#pragma once

#include <cmath>
#include <random>
#include <string>

#include "tests/support/mitsuba_text.h"

namespace ambilux::test {

inline std::string triple(Vec3f v) {
    return std::to_string(v.x) + "," + std::to_string(v.y) + "," + std::to_string(v.z);
}
inline std::string color(const std::string& name, double value) {
    return "<rgb name='" + name + "' value='" + std::to_string(value) + "'/>";
}
inline std::string looking(Vec3f from, Vec3f to) {
    return "<transform name='to_world'><lookat origin='" + triple(from) + "' target='" + triple(to) +
           "' up='0.1,1,0.2'/></transform>";
}
inline std::string sized(double scale, Vec3f from, Vec3f to) {
    return "<transform name='to_world'><scale value='" + std::to_string(scale) + "'/><lookat origin='" + triple(from) +
           "' target='" + triple(to) + "' up='0.1,1,0.2'/></transform>";
}

/// A lamp at `p` that faces `to`, one of `kLampKinds`.
constexpr uint32_t kLampKinds = 8;
inline std::string lamp_of_kind(uint32_t kind, Vec3f p, Vec3f to, double size, double power) {
    const std::string lit =
        "<bsdf type='diffuse'/><emitter type='area'>" + color("radiance", power) + "</emitter></shape>";
    const std::string at = "<point name='center' x='" + std::to_string(p.x) + "' y='" + std::to_string(p.y) + "' z='" +
                           std::to_string(p.z) + "'/><float name='radius' value='" + std::to_string(size) + "'/>";
    switch (kind % kLampKinds) {
        case 0: return "<shape type='rectangle'>" + sized(size, p, to) + lit;
        case 1: return "<shape type='sphere'>" + at + lit;
        case 2: return "<shape type='disk'>" + sized(size, p, to) + lit;
        case 3: return "<shape type='cube'>" + sized(size, p, to) + lit;
        case 4:
            return "<emitter type='point'><point name='position' x='" + std::to_string(p.x) + "' y='" +
                   std::to_string(p.y) + "' z='" + std::to_string(p.z) + "'/>" +
                   color("intensity", power * size * size) + "</emitter>";
        case 5:
            return "<emitter type='spot'>" + color("intensity", power * size * size) +
                   "<float name='cutoff_angle' value='40'/><float name='beam_width' value='25'/>" + looking(p, to) +
                   "</emitter>";
        case 6:
            return "<shape type='cylinder'><float name='radius' value='" + std::to_string(0.3 * size) +
                   "'/><point name='p0' x='" + std::to_string(p.x) + "' y='" + std::to_string(p.y) + "' z='" +
                   std::to_string(p.z) + "'/><point name='p1' x='" + std::to_string(p.x + size) + "' y='" +
                   std::to_string(p.y) + "' z='" + std::to_string(p.z + size) + "'/>" + lit;
        default:
            return "<emitter type='collimated'>" + color("power", power * size * size) + looking(p, to) + "</emitter>";
    }
}

/// `count` lamps of all kinds in the cube of side 2 around the origin, a sun and a sky.
inline std::string many_lamps(uint32_t count, uint32_t seed, bool infinite = true) {
    std::mt19937 random(seed);
    const auto in = [&](double a, double b) { return a + (b - a) * double(random() >> 8) / 16777216.0; };
    const auto place = [&] { return Vec3f{float(in(-1, 1)), float(in(-1, 1)), float(in(-1, 1))}; };
    std::string s =
        "<shape type='rectangle'><transform name='to_world'><scale value='3'/><rotate x='1' angle='-90'/><translate "
        "y='-1.2'/></transform><bsdf type='diffuse'/></shape>";
    for (uint32_t i = 0; i < count; ++i) {
        const Vec3f p = place(), to = place();
        s += lamp_of_kind(i, p, to, std::exp(in(-6, -2.5)), std::exp(in(-1, 3)));
    }
    if (infinite)
        s += "<emitter type='directional'><vector name='direction' x='-0.8' y='-1.2' z='-0.6'/>" +
             color("irradiance", 0.3) + "</emitter><emitter type='constant'>" + color("radiance", 0.1) + "</emitter>";
    return s;
}

}  // namespace ambilux::test
