// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// seconds: 20
// vcm, variant correlated: it finds the light that vcm finds, and no thread, wave or budget decides a bit.
#include "integrators/registry.h"
#include "tests/support/merging_renders.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;

namespace {

RenderSettings correlated(const Scene& scene, const char* radius) {
    return vcm_settings(scene, radius, "vcm", "correlated");
}

}  // namespace

TEST_CASE("vcm correlated: inside a glowing sphere all masks of strategies find the same radiance") {
    const Scene scene = glowing_sphere();
    for (const char* mask : {"all", "hits", "hits+next_event"})
        for (const char* heuristic : {"balance", "power"})
            for (const char* first : {"true", "false"}) {
                if (heuristic == std::string("power") && first == std::string("false")) continue;
                RenderSettings s = correlated(scene, "0.1");
                apply_setting(s, "strategies", mask);
                apply_setting(s, "heuristic", heuristic);
                apply_setting(s, "merge_first", first);
                INFO(mask << ", " << heuristic << ", merges at first vertices: " << first);
                check_glow(mean_over_seeds(scene, s, 16, 6));
            }
}

TEST_CASE("vcm correlated has the mean of vcm, by other weights") {
    for (const char* name : {"cornell", "glass", "lights"}) {
        const Scene scene = project_scene(name, 32, 24);
        INFO(name);
        const Mean plain = mean_over_seeds(scene, vcm_settings(scene, "0.005"), 16, 8),
                   weighed = mean_over_seeds(scene, correlated(scene, "0.005"), 16, 8);
        CHECK(std::fabs(weighed.value - plain.value) <
              4.0 * std::hypot(plain.error, weighed.error) + 0.01 * plain.value);
        const RenderResult one = render_scene(scene, correlated(scene, "0.005"), 4);
        CHECK(one.film.sum != render_scene(scene, vcm_settings(scene, "0.005"), 4).film.sum);
        CHECK(one.stats.invalid.total() == 0);
        for (const QueueStats& q : one.stats.queues) CHECK(q.overflow == 0);
    }
}

TEST_CASE("vcm correlated: the same bits for any number of threads, size of waves and budget") {
    const Scene scene = project_scene("glass", 56, 40);
    for (const char* samples : {"1", "4"}) {
        RenderSettings s = correlated(scene, "0.01");
        apply_setting(s, "merge_samples", samples);
        INFO(samples << " samples an iteration");
        check_bits_on_cpu(scene, s, 4, 64);
    }
}

TEST_CASE("vcm correlated goes on from its film alone") {
    const Scene scene = project_scene("cornell", 24, 24);
    RenderSettings s = correlated(scene, "0.01");
    apply_setting(s, "merge_samples", "4");
    check_resumes_from_film(scene, s);
    CHECK(bias_text(s) == bias_text(vcm_settings(scene, "0.01")));
}
