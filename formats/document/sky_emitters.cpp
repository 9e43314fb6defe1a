// Emitters sky, sun and sunsky: environment maps that are made when the scene is loaded.
#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "formats/document/builder.h"
#include "formats/document/sky.h"

namespace ambilux::document {

namespace {

/// Sizes of images. The sky is smooth but ends at the horizon, where a row is a ramp; the sun is half a degree wide.
constexpr uint32_t kSkyWidth = 512, kSkyHeight = 2048, kSunWidth = 2048, kSunHeight = 2048;
constexpr double kSunDegrees = 0.5358;

/// What an emitter asks for, in the frame of our environment maps: +y is up, azimuth 0 is -z and grows towards +x.
struct SkySettings {
    double turbidity, sky_scale, sun_scale, sun_degrees, stretch;
    bool extend;
    Rgb albedo;
    Vec3d sun;  ///< unit direction to it
};

bool is_newer(const Reader& in) { return in.object().version >= 2; }

Vec3d on_sphere(double zenith, double azimuth) {
    return {std::sin(azimuth) * std::sin(zenith), std::cos(zenith), -std::cos(azimuth) * std::sin(zenith)};
}

/// From the frame of environment maps to that of the plugin. The newer one has +z up, north at -x and east at -y.
Matrix map_to_local(bool newer) { return newer ? from_columns({1, 0, 0}, {0, 0, 1}, {0, -1, 0}) : Matrix{}; }

int whole(Reader& in, const char* name, int fallback) {
    const int64_t value = in.integer(name, fallback);
    if (value < -10000 || value > 10000) in.fail(in.where(name), "'" + std::to_string(value) + "' is no date");
    return int(value);
}

SunTime read_time(Reader& in) {
    SunTime t;
    t.year = whole(in, "year", t.year), t.month = whole(in, "month", t.month), t.day = whole(in, "day", t.day);
    t.hour = in.number("hour", t.hour), t.minute = in.number("minute", t.minute);
    t.second = in.number("second", t.second);
    t.latitude = in.number("latitude", t.latitude), t.longitude = in.number("longitude", t.longitude);
    t.timezone = in.number("timezone", t.timezone);
    return t;
}

/// Direction to the sun in the frame of the map. `to_world`: of the map.
Vec3d read_sun(Reader& in, const Matrix& to_world) {
    const SunTime time = read_time(in);
    Vec3d d;
    if (in.has("sun_direction")) {
        const Vec3d given = in.vector("sun_direction", {});
        if (!(length(given) > 0)) in.fail(in.where("sun_direction"), "the direction of the sun is zero");
        d = transformed(affine_inverse(to_world), unit(given), 0);
    } else {
        const SunAngles a = sun_position(time);
        // The newer plugin counts its azimuth from +x to +y, and the sun stands at azimuth - 180 degrees.
        const double phi = a.azimuth - M_PI;
        d = is_newer(in)
                ? Vec3d{std::sin(a.zenith) * std::cos(phi), std::cos(a.zenith), -std::sin(a.zenith) * std::sin(phi)}
                : on_sphere(a.zenith, a.azimuth);
    }
    if (!(d.y > 0)) in.fail("the sun is below the horizon");
    return d;
}

double scale_parameter(Reader& in, const char* name) {
    const double value = in.number(name, 1);
    if (!(value >= 0 && value <= 1e30)) in.fail(in.where(name), std::string(name) + " must not be negative");
    return value;
}

SkySettings read_settings(Reader& in, const Matrix& to_world) {
    SkySettings s{};
    const std::string& type = in.object().type;
    s.turbidity = in.number("turbidity", 3);
    if (!(s.turbidity >= 1 && s.turbidity <= 10)) in.fail(in.where("turbidity"), "turbidity must lie between 1 and 10");
    s.albedo = in.color("albedo", splat(is_newer(in) ? 0.3f : 0.2f), SpectrumUse::reflectance);
    s.stretch = in.number("stretch", 1);
    if (!(s.stretch >= 1 && s.stretch <= 2)) in.fail(in.where("stretch"), "stretch must lie between 1 and 2");
    s.extend = in.boolean("extend", false);
    const double scale = scale_parameter(in, "scale");
    s.sky_scale = type == "sun" ? 0 : scale * scale_parameter(in, "sky_scale");
    s.sun_scale = type == "sky" ? 0 : scale * scale_parameter(in, "sun_scale");
    const double radius_scale = in.number("sun_radius_scale", 1);
    s.sun_degrees = in.number("sun_aperture", kSunDegrees * radius_scale);
    if (!(s.sun_degrees > 0 && s.sun_degrees < 90))
        in.fail(in.where(in.has("sun_aperture") ? "sun_aperture" : "sun_radius_scale"),
                "the sun must be between 0 and 90 degrees wide");
    s.sun = read_sun(in, to_world);
    in.ignore({"resolution"});
    if (in.boolean("complex_sun", false))
        in.fail(in.where("complex_sun"), "complex_sun is not supported: the sun has the same radiance everywhere");
    return s;
}

struct Image {
    uint32_t width, height;
    std::vector<float> texels;

    Vec3d direction(double x, double y) const {
        return on_sphere(M_PI * y / (height - 1), 2 * M_PI * (x + 0.5) / width);
    }
    void add(uint32_t x, uint32_t y, Rgb c) {
        for (int i = 0; i < 3; ++i) texels[4 * (size_t(y) * width + x) + size_t(i)] += c[i];
    }
};

void add_sky(Image& image, const SkySettings& s) {
    const double elevation = std::asin(std::min(s.sun.y, 1.0));
    const Sky sky(s.turbidity, s.albedo, elevation);
    parallel_for(image.height, [&](uint32_t y) {
        double zenith = M_PI * y / (image.height - 1) / s.stretch, fade = 1;
        if (!(std::cos(zenith) > 0)) {
            if (!s.extend) return;
            zenith = M_PI / 2 - 1e-4;
        }
        if (s.extend) {  // Mitsuba 0.6: fades out towards the nadir
            const double t = std::clamp(2 - 2.0 * y / (image.height - 1), 0.0, 1.0);
            fade = t * t * (3 - 2 * t);
        }
        for (uint32_t x = 0; x < image.width; ++x) {
            const Vec3d d = on_sphere(zenith, 2 * M_PI * (x + 0.5) / image.width);
            const double angle = std::acos(std::clamp(dot(d, s.sun), -1.0, 1.0));
            image.add(x, y, sky.radiance(std::cos(zenith), angle) * float(s.sky_scale * fade));
        }
    });
}

/// A disk about the sun, scaled so that the map has exactly its irradiance, whatever texels are.
void add_sun(Image& image, const SkySettings& s) {
    constexpr int kSteps = 8;
    const double half = s.sun_degrees / 2 * (M_PI / 180), zenith = std::acos(std::min(s.sun.y, 1.0));
    const double row = M_PI / (image.height - 1), column = 2 * M_PI / image.width;
    struct Part {
        uint32_t x, y;
        double share;
    };
    std::vector<Part> parts;
    double sum = 0;
    const auto first = uint32_t(std::max(0.0, (zenith - half) / row - 1)),
               last = uint32_t(std::min(double(image.height - 1), (zenith + half) / row + 1));
    for (uint32_t y = first; y <= last; ++y)
        for (uint32_t x = 0; x < image.width; ++x) {
            if (dot(image.direction(x, y), s.sun) < std::cos(half + 2 * (row + column))) continue;
            int inside = 0;
            for (int k = 0; k < kSteps * kSteps; ++k) {
                const double dx = (k % kSteps + 0.5) / kSteps - 0.5, dy = (k / kSteps + 0.5) / kSteps - 0.5;
                inside += dot(image.direction(x + dx, y + dy), s.sun) >= std::cos(half);
            }
            if (!inside) continue;
            const double share = double(inside) / (kSteps * kSteps);
            // Solid angle that a texel's bilinear hat weighs.
            sum += share * std::sin(std::max<uint32_t>(y, 1) * row) * row * column;
            parts.push_back({x, y, share});
        }
    const Rgb irradiance = sun_irradiance(s.turbidity, M_PI / 2 - zenith) * float(s.sun_scale);
    for (const Part& p : parts) image.add(p.x, p.y, irradiance * float(p.share / sum));
}

}  // namespace

bool is_sky(const std::string& type) { return type == "sky" || type == "sun" || type == "sunsky"; }

void read_sky(Builder& builder, Reader& in, const Matrix& rotation, Emitter& out) {
    const bool newer = is_newer(in);
    const Matrix to_world = rotation * map_to_local(newer);
    const SkySettings settings = read_settings(in, to_world);
    if (settings.sun_scale > 0 && !newer)
        builder.note(in.where(), "the sun is that of Hosek and Wilkie 2013, not that of Preetham et al. 1999");

    const bool sun = settings.sun_scale > 0;
    Image image{sun ? kSunWidth : kSkyWidth, sun ? kSunHeight : kSkyHeight, {}};
    if (image.width * image.height > builder.options.limits.pixels)
        in.fail("a sky is an image of " + std::to_string(image.width) + "x" + std::to_string(image.height) +
                " pixels, which is larger than --limits pixels=" + std::to_string(builder.options.limits.pixels));
    builder.take_memory(uint64_t(image.width) * image.height * 4 * sizeof(float), in.where().file);
    image.texels.assign(size_t(image.width) * image.height * 4, 0.0f);
    if (settings.sky_scale > 0) add_sky(image, settings);
    if (settings.sun_scale > 0) add_sun(image, settings);

    out.type = EmitterType::envmap;
    place(out, to_world);
    out.radiance = {splat(1), add_environment_image(builder, image.width, image.height, image.texels)};
}

}  // namespace ambilux::document
