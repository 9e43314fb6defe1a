// Renders of light tracing and bidirectional path tracing as estimates whose pixels depend on each other, and their
// comparison.
#pragma once

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "film/ztest.h"
#include "tests/support/closed_forms.h"
#include "tests/support/injected_bias.h"

namespace ambilux {

/// One bidirectional method: "-i light", or the strategies of bdpt.
struct Method {
    std::string name;  ///< "-i light", or a value of --set strategies
    MisHeuristic heuristic = MisHeuristic::balance;
    std::string variant = "wavefront";
};

/// One of each kind: all strategies by either heuristic, one subpath alone, one group alone.
inline const Method kMethods[] = {{"all"},  {"all", MisHeuristic::power}, {"-i light"},
                                  {"hits"}, {"next_event+connections"},   {"light"}};

/// Every variant, light tracing, and the group of strategies `last` alone.
inline std::vector<Method> methods_and(const char* last) {
    return {{"all"},
            {"all", MisHeuristic::power},
            {"all", MisHeuristic::balance, "megakernel"},
            {"all", MisHeuristic::balance, "lvc"},
            {"all", MisHeuristic::balance, "streaming"},
            {"-i light"},
            {"light"},
            {last}};
}

inline RenderSettings method_settings(const Scene& scene, const Method& method, uint64_t seed) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.heuristic = method.heuristic;
    if (method.name == "-i light") {
        s.integrator = "light";
    } else {
        s.integrator = "bdpt";
        s.variant = method.variant;
        apply_setting(s, "strategies", method.name);
    }
    return s;
}

inline constexpr uint32_t kBatches = 32;

/// `spp` samples (a multiple of kBatches) from sample `first` on, as batches or added to those there are.
inline void add_batches(Renderer& renderer, uint32_t spp, uint32_t first, std::vector<FilmMoments>& batches) {
    REQUIRE(spp % kBatches == 0);
    const uint32_t n = spp / kBatches;
    const bool fresh = batches.empty();
    for (uint32_t k = 0; k < kBatches; ++k) {
        renderer.clear_film();
        REQUIRE(renderer.render(first + k * n, n) == n);
        if (fresh)
            batches.push_back(renderer.film());
        else
            batches[k].add(renderer.film());
    }
}

inline void check_none_invalid(Renderer& renderer) {
    const RenderStats stats = renderer.stats();
    for (const auto& [stage, invalid] : stats.invalid_by_stage) {
        INFO("stage " << stage << ": " << invalid.nan << " NaN, " << invalid.inf << " Inf, " << invalid.negative
                      << " negative, " << invalid.underflow << " below the range of floats");
        CHECK(invalid.total() == 0);
    }
}

/// `spp` samples (a multiple of kBatches) from sample `first` on. One light subpath splats onto many pixels, so
/// variances of blocks come from batches of samples.
inline Estimate render_batches(const Scene& scene, const RenderSettings& settings, uint32_t spp, uint32_t first = 0) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    std::vector<FilmMoments> batches;
    add_batches(*renderer, spp, first, batches);
    check_none_invalid(*renderer);
    return to_estimate(batches);
}

/// As until_seen(), in batches.
inline Estimate render_until(const Scene& scene, const RenderSettings& settings, uint32_t few, uint32_t most,
                             const Estimate& truth, double sees, const ZTestOptions& options = {}) {
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
    std::vector<FilmMoments> batches;
    const Estimate image =
        until_seen(few, most / kBatches * kBatches, truth, sees, options, [&](uint32_t done, uint32_t n) {
            add_batches(*renderer, n, done, batches);
            return to_estimate(batches);
        });
    check_none_invalid(*renderer);
    return image;
}

/// What the path tracer finds.
inline Estimate render_path(const Scene& scene, uint32_t spp, uint64_t seed = 1001) {
    const RenderResult r = render_scene(scene, cpu_settings(scene, Estimator::mis, seed), spp);
    CHECK(r.stats.invalid.total() == 0);
    return to_estimate(r.film);
}

/// a + b of independent images of equally many batches.
inline Estimate sum(const Estimate& a, const Estimate& b) {
    REQUIRE(a.batches.size() == b.batches.size());
    Estimate r = a;
    for (size_t i = 0; i < r.mean.size(); ++i) {
        r.mean[i] += b.mean[i];
        r.variance_of_mean[i] += b.variance_of_mean[i];
        for (size_t k = 0; k < r.batches.size(); ++k) r.batches[k][i] += b.batches[k][i];
    }
    return r;
}

/// Fails unless renders have `expected` as their expectation; takes as many samples as it needs to see a mean that is
/// 1.4% off, at most `most`: what is 2% off is then found nearly always.
inline void check_image(const Scene& scene, const RenderSettings& settings, const Image& expected,
                        uint32_t most = 1u << 15) {
    ZTestOptions options;
    options.block = 4;
    options.rounding = 1e-5;
    constexpr double kAim = 0.014, kSees = 0.02;
    const Estimate truth = exact_estimate(expected),
                   image = render_until(scene, settings, 64, most, truth, kAim, options);
    double worst = 0;
    for (size_t i = 0; i < truth.mean.size(); ++i)
        worst = std::max(worst, std::abs(image.mean[i] - truth.mean[i]) / std::max(1e-30, truth.mean[i]));
    if (worst < 2e-5) return;  // without variance
    const ZTestResult z = z_test(image, truth, options);
    INFO(image.samples << " samples: " << z.report());
    // Almost without variance: the few subpaths that differ are too few to be tested, and together may matter one in
    // 1000 at most.
    if (z.undecided) {
        CHECK(std::abs(z.relative_difference) < kNoVariance);
    } else {
        CHECK(z.pass);
        CHECK(sees_bias(image, truth, kSees, options));
    }
    CHECK(z.detectable < kSees);
}

/// Fails unless both have the same expectation and a difference of `sees` of the whole is noticed, which is tried.
inline void check_agreement(const Estimate& a, const Estimate& b, double sees, const ZTestOptions& options = {}) {
    const ZTestResult z = z_test(a, b, options);
    INFO(z.report());
    CHECK(z.pass);
    CHECK(z.detectable < sees);
    CHECK(sees_bias(a, b, sees, options));
}

/// The same for a render of as many samples as it takes to notice that, at most `most`, and a quarter of these at
/// least: fewer miss what is rare.
inline void check_agreement(const Scene& scene, const RenderSettings& settings, uint32_t most, const Estimate& truth,
                            double sees, const ZTestOptions& options = {}) {
    const uint32_t few = std::max(1u, most / 4 / kBatches) * kBatches;
    const Estimate image = render_until(scene, settings, few, most, truth, sees, options);
    INFO(image.samples << " of " << most << " samples");
    check_agreement(image, truth, sees, options);
}

// ---- a plane at z = 0, seen from above in [-1,1]², and its light ----

inline constexpr Rgb kLight = {3, 5, 2};
inline const Method kAll = {"all"}, kPower = {"all", MisHeuristic::power}, kLightTracer = {"-i light"};

inline constexpr uint32_t kSize = 16;
inline constexpr Rgb kPlaneAlbedo = {0.5f, 0.7f, 0.3f};

inline std::string film(uint32_t size, const std::string& filter = "box", const std::string& crop = "") {
    const std::string n = std::to_string(size);
    return "<film type='hdrfilm'><integer name='width' value='" + n + "'/><integer name='height' value='" + n + "'/>" +
           crop + "<rfilter type='" + filter + "'/></film>";
}
inline std::string lookat(const std::string& value) {
    return "<transform name='to_world'><lookat " + value + "/></transform>";
}
inline std::string orthographic(const std::string& film_xml = film(kSize)) {
    return "<sensor type='orthographic'>" + lookat("origin='0,0,0.1' target='0,0,0' up='0,1,0'") + film_xml +
           "</sensor>";
}
inline const std::string kPlane =
    "<shape type='rectangle'><transform name='to_world'><scale value='1.5'/></transform>" + diffuse(kPlaneAlbedo) +
    "</shape>";
inline Scene plane_under(const std::string& light, const std::string& camera = orthographic(), int max_depth = 2) {
    return scene_from_text(scene_xml(max_depth, camera + kPlane + light));
}

template <class Function>
Image plane_image(Rgb color, Function irradiance) {
    return image_of(kSize, kSize, color * kPlaneAlbedo,
                    [&](double x, double y) { return irradiance(-1 + 2 * x / kSize, 1 - 2 * y / kSize) / M_PI; });
}

inline const std::string kSphereLight =
    "<shape type='sphere'><point name='center' x='0.3' y='-0.2' z='1.5'/><float name='radius' value='0.5'/>" +
    diffuse({0, 0, 0}) + area_light(kLight) + "</shape>";

/// Irradiance per radiance of that sphere: pi (r/d)² cos.
inline double sphere_irradiance(double x, double y) {
    const double dx = 0.3 - x, dy = -0.2 - y, d2 = dx * dx + dy * dy + 2.25;
    return M_PI * 0.25 / d2 * 1.5 / std::sqrt(d2);
}

/// A rectangle of half sides (a,b), turned down, at (x,y,z).
inline std::string lamp(double a, double b, double x, double y, double z, Rgb radiance = kLight,
                        const std::string& bsdf = diffuse({0, 0, 0})) {
    std::ostringstream s;
    s << "<shape type='rectangle'><transform name='to_world'><scale x='" << a << "' y='" << b
      << "'/><rotate x='1' angle='180'/><translate x='" << x << "' y='" << y << "' z='" << z << "'/></transform>"
      << bsdf << area_light(radiance) << "</shape>";
    return s.str();
}

/// Irradiance per radiance at (x,y,0) of the rectangle [x0,x1] x [y0,y1] at height z that faces it: corner by corner
/// (Howell's catalog, B-3).
inline double rectangle_irradiance(double x, double y, double x0, double x1, double y0, double y1, double z) {
    const auto corner = [z](double a, double b) {
        const double p = std::sqrt(a * a + z * z), q = std::sqrt(b * b + z * z);
        return 0.5 * (a / p * std::atan(b / p) + b / q * std::atan(a / q));
    };
    return corner(x1 - x, y1 - y) - corner(x0 - x, y1 - y) - corner(x1 - x, y0 - y) + corner(x0 - x, y0 - y);
}

/// Compares methods with the path tracer; `sees` bounds ZTestResult::detectable. `spp`: at most.
inline void agree(const Scene& scene, const std::vector<Method>& methods, uint32_t path_spp, uint32_t spp,
                  double sees) {
    const Estimate path = render_path(scene, path_spp);
    uint64_t seed = 1;
    for (const Method& m : methods) {
        INFO(m.name << (m.heuristic == MisHeuristic::power ? ", power" : ""));
        check_agreement(scene, method_settings(scene, m, seed++), spp, path, sees);
    }
}

/// Of stages that are fused, and of stages of their own, which hold all features: the same bits.
inline std::pair<RenderResult, RenderResult> check_stages_of_their_own(const Scene& scene, RenderSettings s,
                                                                       uint32_t spp) {
    s.specialise = false;
    const RenderResult fused = render_scene(scene, s, spp);
    s.fuse = Fuse::none;
    const RenderResult staged = render_scene(scene, s, spp);
    CHECK(fused.film.sum == staged.film.sum);
    CHECK(fused.film.sum_squares == staged.film.sum_squares);
    return {fused, staged};
}

}  // namespace ambilux
