// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 10
// Merges alone: bias by radius, variance by light subpaths and the rate of both over iterations, beside closed forms.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "accel/embree_tracer.h"
#include "accel/shared_accels.h"
#include "integrators/bdpt/vcm/pixel_radius.h"
#include "tests/support/long_run.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

constexpr double kPi64 = std::numbers::pi, kAlbedo = 0.5;
constexpr const char* kBeam = "<emitter type='directionalarea'><rgb name='radiance' value='2'/></emitter>";

/// A camera of parallel rays at z = 0.4 that sees the floor z = 0 for |x| < 1.
std::string above_floor(int width, int height, int max_depth) {
    return "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='" +
           std::to_string(max_depth) +
           "'/></integrator><sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,0.4' "
           "target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='" +
           std::to_string(width) + "'/><integer name='height' value='" + std::to_string(height) +
           "'/><rfilter type='box'/></film></sensor><shape type='rectangle'><transform name='to_world'><scale "
           "value='2'/></transform><bsdf type='diffuse'><rgb name='reflectance' value='0.5'/></bsdf></shape>";
}

/// Light of a beam on x < 0 alone: where it ends there is a step. Every light vertex has as much flux.
constexpr int kWidth = 32, kHeight = 8;
constexpr double kBeamArea = 1.5 * 3;
Scene step() {
    return scene_from_text(above_floor(kWidth, kHeight, 2) +
                           "<shape type='rectangle'><transform name='to_world'><scale x='0.75' y='1.5'/><rotate x='1' "
                           "angle='180'/><translate x='-0.75' z='1'/></transform>" +
                           std::string(kBeam) + "</shape></scene>");
}

/// Share of a disk of radius 1 around a point whose distance from the step is `x`, on the side without light.
double lit_share(double x) {
    const double c = std::clamp(x, -1.0, 1.0);
    return (std::acos(c) - c * std::sqrt(1 - c * c)) / kPi64;
}
/// Mean over the pixels of column `i`.
double lit_column(int i, double radius) {
    constexpr int kParts = 64;
    double sum = 0;
    for (int k = 0; k < kParts; ++k) sum += lit_share((2 * (i + (k + 0.5) / kParts) / kWidth - 1) / radius);
    return sum / kParts;
}

RenderSettings merging(const Scene& scene, const char* integrator, double radius, const char* alpha = nullptr) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 3);
    s.integrator = integrator;
    apply_setting(s, "merge_radius", std::to_string(radius / double(scene.view().bounds_radius)));
    apply_setting(s, "light_paths", "16");
    if (alpha) apply_setting(s, "merge_alpha", alpha);
    return s;
}

struct Moments {
    std::vector<double> mean, variance;  ///< by column, of a column's mean
    double of_pixel = 0;  ///< variance of a pixel that is lit and farther than the radius from where light ends
};
Moments columns(const Scene& scene, RenderSettings s, uint32_t samples, uint32_t seeds) {
    constexpr int kLit[] = {1, 8};  // columns, 0.9 and 0.47 from the step
    std::vector<double> sum(kWidth + 2), squares(kWidth + 2);
    const auto add = [&](size_t i, double v) { sum[i] += v, squares[i] += v * v; };
    for (uint32_t k = 0; k < seeds; ++k) {
        s.seed = 50 + k;
        const FilmMoments film = render_scene(scene, s, samples).film;
        const auto value = [&](int x, int y) { return film.mean(size_t(y * kWidth + x) * 3); };
        for (int x = 0; x < kWidth; ++x) {
            double column = 0;
            for (int y = 0; y < kHeight; ++y) column += value(x, y) / kHeight;
            add(size_t(x), column);
        }
        for (size_t i = 0; i < 2; ++i) add(kWidth + i, value(kLit[i], kHeight / 2));
    }
    Moments m;
    for (size_t x = 0; x < kWidth + 2; ++x) {
        const double mean = sum[x] / seeds, variance = (squares[x] / seeds - mean * mean) * seeds / (seeds - 1);
        if (x < kWidth) {
            m.mean.push_back(mean);
            m.variance.push_back(variance);
        } else {
            m.of_pixel += variance / 2;
        }
    }
    return m;
}

void check_columns(const Moments& m, uint32_t seeds, const std::function<double(int)>& share) {
    for (int x = 0; x < kWidth; ++x) {
        INFO("column " << x);
        const double expected = kAlbedo / kPi64 * 2 * share(x);
        CHECK(std::fabs(m.mean[size_t(x)] - expected) <
              4.5 * std::sqrt(m.variance[size_t(x)] / seeds) + 2e-4 * kAlbedo);
    }
}

}  // namespace

TEST_CASE("Beside a step of light, merges find what a disk of their radius holds") {
    const Scene scene = step();
    for (const char* integrator : {"pm", "ppm", "sppm", "bpm", "vcm"})
        for (const double radius : {0.3, 0.1}) {
            INFO(integrator << ", radius " << radius);
            const char* const stays = std::string(integrator) == "pm" ? nullptr : "1";
            constexpr uint32_t kSeeds = 48;
            check_columns(columns(scene, merging(scene, integrator, radius, stays), 1, kSeeds), kSeeds,
                          [&](int x) { return lit_column(x, radius); });
        }
}

TEST_CASE("Over iterations the radius shrinks as Knaus and Zwicker 2011 say: bias and variance have their rates") {
    const Scene scene = step();
    constexpr double kRadius = 0.3, kAlpha = 0.6;
    for (const auto& [iterations, seeds] : first_or_all<std::pair<uint32_t, uint32_t>>(1, {{12, 96}, {1, 320}})) {
        INFO(iterations << " iterations");
        const auto radius = [&](uint32_t i) { return kRadius * std::pow(i + 1.0, 0.5 * (kAlpha - 1)); };
        const uint32_t k = iterations;
        const Moments m = columns(scene, merging(scene, "ppm", kRadius, "0.6"), k, seeds);
        check_columns(m, seeds, [&](int x) {
            double sum = 0;
            for (uint32_t i = 0; i < k; ++i) sum += lit_column(x, radius(i));
            return sum / k;
        });
        // Light vertices in a disk: a binomial count, whose relative variance this is.
        double expected = 0;
        for (uint32_t i = 0; i < k; ++i) {
            const double n = 16.0 * kWidth * kHeight, p = kPi64 * radius(i) * radius(i) / kBeamArea;
            expected += (1 - p) / (n * p) / (double(k) * k);
        }
        const double measured = m.of_pixel / std::pow(kAlbedo / kPi64 * 2, 2);
        // The relative error of a variance of n normal values is sqrt(2 / (n - 1)), of the mean of two sqrt(1 / (n -
        // 1)).
        CHECK(std::fabs(measured / expected - 1) < 4.5 / std::sqrt(seeds - 1.0));
    }
}

TEST_CASE("A caustic has the flux that enters it, at any radius") {
    const Scene scene = scene_from_text(
        above_floor(24, 24, 4) +
        "<shape type='sphere'><point name='center' x='0' y='0' z='1'/><float name='radius' value='0.5'/><bsdf "
        "type='dielectric'/></shape><shape type='rectangle'><transform name='to_world'><scale value='0.25'/><rotate "
        "x='1' "
        "angle='180'/><translate z='3'/></transform>" +
        std::string(kBeam) + "</shape></scene>");
    // What enters the ball and leaves it at once; the same angles on both ways, of index 1.5046 over 1.000277.
    double passed = 0;
    constexpr int kParts = 200;
    for (int i = 0; i < kParts; ++i)
        for (int j = 0; j < kParts; ++j) {
            const double x = 0.25 * (2 * (i + 0.5) / kParts - 1), y = 0.25 * (2 * (j + 0.5) / kParts - 1);
            const double ior = 1.5046 / 1.000277, sine = std::hypot(x, y) / 0.5, cosine = std::sqrt(1 - sine * sine),
                         inside = std::sqrt(1 - sine * sine / (ior * ior));
            const double s = (cosine - ior * inside) / (cosine + ior * inside),
                         p = (ior * cosine - inside) / (ior * cosine + inside), r = 0.5 * (s * s + p * p);
            passed += (1 - r) * (1 - r) * 0.25 / (kParts * kParts);
        }
    const double expected = kAlbedo / kPi64 * 2 * passed / 4;  // over the area that is seen
    for (const char* integrator : first_or_all<const char*>(2, {"vcm", "sppm", "bpm", "pm"}))
        for (const double radius : first_or_all<double>(1, {0.02, 0.3})) {
            INFO(integrator << ", radius " << radius);
            double sum = 0, squares = 0;
            constexpr int kSeeds = 12;
            RenderSettings s = merging(scene, integrator, radius);
            for (int k = 0; k < kSeeds; ++k) {
                s.seed = uint64_t(70 + k);
                const double m = mean_of(render_scene(scene, s, 4).film);
                sum += m / kSeeds, squares += m * m / kSeeds;
            }
            const double error = std::sqrt((squares - sum * sum) / (kSeeds - 1));
            CHECK(std::fabs(sum - expected) < 4.5 * error + 1e-4 * expected);
            CHECK(error < 0.02 * expected);
        }
}

TEST_CASE("The radius of a pixel is that of a disk as large as its footprint") {
    const auto radius = [](const Scene& scene) {
        SharedAccels accels(scene);
        return double(pixel_radius<kAllFeatures>(scene.view(), HostTracer(accels.get<EmbreeAccel>()->tracer())));
    };
    CHECK(radius(step()) == Approx(2.0 / kWidth / std::sqrt(kPi64)));
    const auto perspective = [](double distance) {
        return scene_from_text(
            "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='2'/><transform "
            "name='to_world'><lookat origin='0,0," +
            std::to_string(distance) +
            "' target='0,0,0' up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='40'/><integer "
            "name='height' value='40'/></film></sensor><shape type='rectangle'/></scene>");
    };
    for (const double distance : {3.0, 12.0})
        CHECK(radius(perspective(distance)) ==
              Approx(2 * distance * std::tan(kPi64 / 180) / 40 / std::sqrt(kPi64)).epsilon(1e-3));
    CHECK(
        radius(scene_from_text("<scene version='3.0.0'><sensor type='perspective'/><shape type='rectangle'><transform "
                               "name='to_world'><translate z='-9'/></transform></shape></scene>")) == kInfinity);
}
