// Replays of a scene, and what tests ask of their records.
#pragma once

#include <cmath>

#include "tests/support/replay_settings.h"

namespace ambilux {

constexpr double kPiDouble = 3.14159265358979323846;

inline bool close(double a, double b, double relative = 2e-5) {
    return std::abs(a - b) <= relative * std::abs(b) + 1e-12;
}
inline bool close(Rgb a, Rgb b, double relative = 2e-5) {
    bool all = true;
    for (int c = 0; c < 3; ++c) all = all && close(double(a[c]), double(b[c]), relative);
    return all;
}
inline bool near(Vec3f a, Vec3f b) { return double(length(a - b)) < 1e-4; }

inline double number(const std::vector<ReplayNumber>& all, const std::string& name) {
    for (const ReplayNumber& n : all)
        if (n.name == name) return n.value;
    FAIL("there is no " << name);
    return 0;
}
inline std::string names(const std::vector<ReplayNumber>& all) {
    std::string text;
    for (const ReplayNumber& n : all) text += (text.empty() ? "" : " ") + n.name;
    return text;
}

/// A scene and the replays of a render of it.
struct Replayed {
    const Scene scene;
    const RenderSettings settings;
    mutable SharedAccels accels{scene};
    std::unique_ptr<Replay> replay;

    Replayed(Scene s, const ReplayConfig& c)
        : scene(std::move(s)), settings(settings_of(scene, c)), replay(make_replay(scene, settings, accels)) {}

    uint32_t pixels() const { return scene.sensor.crop_width * scene.sensor.crop_height; }
    ReplayRequest request(uint32_t pixel, uint32_t sample) const {
        return {pixel % scene.sensor.crop_width, pixel / scene.sensor.crop_width, sample, {}, false, true};
    }
    /// The first samples of some pixels, without splats.
    template <class See>
    void each_sample(uint32_t samples, uint32_t step, See see) const {
        for (uint32_t k = 0; k < samples; ++k)
            for (uint32_t p = 0; p < pixels(); p += step) {
                CAPTURE(p, k);
                see(replay->sample(request(p, k)));
            }
    }
    /// see(subpath, its splats) for the light subpaths of the first sample.
    template <class See>
    void each_light_subpath(See see) const {
        for (uint32_t n = 0; n < replay->light_subpaths(); ++n) {
            CAPTURE(n);
            std::vector<ReplayCandidate> splats;
            const ReplaySubpath s = replay->light_subpath(n, 0, true, splats);
            see(s, splats);
        }
    }
};

// ---- "cornell" ----

constexpr Rgb kLamp = {17, 12.5f, 7.5f};
constexpr double kLampArea = 0.5 * 0.4;

/// Reflectance where "cornell" has the point.
inline Rgb cornell_reflectance(const ReplayVertex& v) {
    if (v.emitter != kNone) return {0, 0, 0};
    if (double(v.ng.x) > 0.9999 && double(v.p.x) < -0.9999) return {0.61f, 0.06f, 0.05f};
    if (double(v.ng.x) < -0.9999 && double(v.p.x) > 0.9999) return {0.12f, 0.46f, 0.10f};
    return {0.73f, 0.72f, 0.69f};
}
inline double cosine(const ReplayVertex& v, Vec3f w) { return std::abs(double(dot(v.ng, w))); }

/// What a diffuse vertex throws from `v`'s ray towards `w`.
inline Rgb thrown(const ReplayVertex& v, Vec3f w) {
    return v.throughput * cornell_reflectance(v) * float(cosine(v, w) / kPiDouble);
}

/// The weight follows from the ratio, and what arrives from both and the value.
inline void check_arrival(const ReplayCandidate& c) {
    CHECK(close(double(c.weight), 1 / (1 + double(c.ratio))));
    if (c.fate == ReplayFate::arrived)
        CHECK(close(c.contribution, c.value * c.weight * c.filter));
    else
        CHECK(is_zero(c.contribution));
    CHECK_FALSE(c.drop.happened());
}

}  // namespace ambilux
