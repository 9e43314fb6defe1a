// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// data: tagged
// timeout: 300
// seconds: 35
// The estimators naive, nee and mis (balance, power) have the same expectation on every scene: z-tests of pairs that
// share no random numbers.
#include <algorithm>
#include <cmath>
#include <string_view>

#include "formats/finalize.h"
#include "tests/support/enough_samples.h"
#include "tests/support/long_run.h"
#include "transport/emitter.h"

using namespace ambilux;

namespace {

/// How a scene is compared: size, depth, samples of each estimator, and what the comparison must be able to see of the
/// overall mean. Emitters are hidden from the camera: what is seen directly is the same in all estimators, and its
/// edges would only add variance.
struct Comparison {
    const char* name;
    bool published;
    uint32_t width, height;
    int max_depth;            ///< 0: the scene's own
    uint32_t naive, sampled;  ///< samples per pixel, at most; naive 0: not compared, for the reason given in `why_not`
    double naive_sees, nee_sees, power_sees;  ///< bounds of ZTestResult::detectable
    const char* why_not;
};

constexpr Comparison kComparisons[] = {
    {"furnace", false, 48, 32, 0, 512, 512, 0.006, 0.011, 0.005, nullptr},
    {"textured", false, 48, 32, 0, 1024, 1024, 0.012, 0.012, 0.008, nullptr},
    {"materials", false, 48, 32, 0, 1024, 1024, 0.02, 0.018, 0.013, nullptr},
    {"lights", false, 48, 32, 0, 0, 1024, 0, 0.025, 0.025,
     "point, spot and directional emitters cannot be hit; see below"},
    {"cornell", false, 48, 32, 0, 2048, 512, 0.03, 0.008, 0.008, nullptr},
    // Caustics of a small lamp: all estimators find them by hits alone.
    {"glass", false, 48, 32, 0, 1024, 1024, 0.1, 0.06, 0.06, nullptr},
    {"cornell-box", true, 48, 32, 0, 2048, 512, 0.03, 0.008, 0.008, nullptr},
    // Lamps and their reflections in smooth plates are smaller than a pixel here.
    {"veach-mis", true, 48, 32, 0, 2048, 2048, 0.15, 0.18, 0.08, nullptr},
    {"veach-bidir", true, 32, 32, 2, 0, 1024, 0, 0.045, 0.045,
     "its lamps are met by so few rays that comparisons with naive stay undecided"},
    {"veach-ajar", true, 48, 32, 0, 512, 256, 0.25, 0.08, 0.08, nullptr},
    // Three segments: no caustics, whose rare bright samples would decide alone.
    {"water-caustic", true, 32, 32, 3, 0, 512, 0, 0.02, 0.02,
     "no ray of a naive render meets the lamp, which is very small"},
    {"glass-and-ice", true, 48, 32, 0, 1024, 512, 0.04, 0.035, 0.035, nullptr},
    {"living-room", true, 32, 18, 3, 1024, 1024, 0.07, 0.12, 0.06, nullptr},
    {"staircase", true, 32, 32, 3, 512, 512, 0.08, 0.07, 0.03, nullptr},
};

/// What every run compares; the others with AMBILUX_LONG=1.
bool is_tried(const Comparison& c) {
    const std::string_view first[] = {"textured", "lights", "glass", "veach-mis", "water-caustic", "glass-and-ice"};
    return is_long_run() || std::find(std::begin(first), std::end(first), c.name) != std::end(first);
}

RenderSettings settings_of(const Scene& scene, const Comparison& c, Estimator estimator, MisHeuristic heuristic,
                           uint64_t seed) {
    RenderSettings s = cpu_settings(scene, estimator, seed);
    s.heuristic = heuristic;
    if (c.max_depth) s.max_depth = c.max_depth;
    return s;
}

/// `spp`: at most.
void check_pair(const char* name, const Scene& scene, const RenderSettings& settings, uint32_t spp, const Estimate& mis,
                double sees) {
    const Estimate image = render_until_seen(scene, settings, spp, mis, sees);
    const ZTestResult z = z_test(image, mis);
    INFO(name << " against mis, " << image.samples << " samples: " << z.report());
    CHECK(z.pass);
    CHECK(z.detectable < sees);
    CHECK(sees_bias(image, mis, sees));
}

void compare(Scene scene, const Comparison& c) {
    scene.integrator.hide_emitters = true;
    const auto settings = [&](Estimator estimator, MisHeuristic heuristic, uint64_t seed) {
        return settings_of(scene, c, estimator, heuristic, seed);
    };
    const RenderResult r = render_scene(scene, settings(Estimator::mis, MisHeuristic::balance, 11), c.sampled);
    CHECK(r.stats.invalid.total() == 0);
    const Estimate mis = to_estimate(r.film);
    check_pair("nee", scene, settings(Estimator::nee, MisHeuristic::balance, 12), c.sampled, mis, c.nee_sees);
    check_pair("mis with the power heuristic", scene, settings(Estimator::mis, MisHeuristic::power, 13), c.sampled, mis,
               c.power_sees);
    if (c.naive)
        check_pair("naive", scene, settings(Estimator::naive, MisHeuristic::balance, 14), c.naive, mis, c.naive_sees);
    else
        REQUIRE(c.why_not);
}

}  // namespace

TEST_CASE("Estimators agree on the project's scenes", "[path]") {
    for (const Comparison& c : kComparisons) {
        if (c.published || !is_tried(c)) continue;
        INFO(c.name << ", max_depth " << c.max_depth);
        compare(project_scene(c.name, c.width, c.height), c);
    }
}

TEST_CASE("Estimators agree on the published scenes", "[path][data]") {
    for (const Comparison& c : kComparisons) {
        if (!c.published || !is_tried(c)) continue;
        INFO(c.name << ", max_depth " << c.max_depth);
        const std::optional<Scene> scene = published_scene(c.name, c.width, c.height);
        if (!scene) return;
        compare(*scene, c);
    }
}

TEST_CASE("Where lights cannot be hit, naive finds what is left", "[path]") {
    // lights.xml without its point, spot and directional emitters.
    Scene scene = project_scene("lights", 48, 32);
    std::erase_if(scene.emitters, [](const Emitter& e) { return is_delta(e.type); });
    for (Shape& s : scene.shapes)
        for (uint32_t i = 0; i < scene.emitters.size(); ++i)
            if (s.emitter != kNone && scene.emitters[i].type == EmitterType::area &&
                &scene.shapes[scene.emitters[i].shape] == &s)
                s.emitter = i;
    for (uint32_t i = 0; i < scene.emitters.size(); ++i)
        if (scene.emitters[i].type == EmitterType::envmap) scene.environment = i;
    finalize_scene(scene, LightPicking::power);
    const Comparison c = {"lights", false, 48, 32, 0, 1024, 512, 0.04, 0.04, 0.04, nullptr};
    compare(std::move(scene), c);
}
