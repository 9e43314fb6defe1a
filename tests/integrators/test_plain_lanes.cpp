// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_core
// timeout: 120
// Plain vertices of path and connections of bdpt in lanes (backends/cpu/plain_lanes.h, connection_lanes.h) against the
// same render without.
#include <algorithm>

#include "backends/cpu/plain_vertices.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

/// Pairs that were connected.
uint64_t pairs_of(const RenderResult& r) {
    for (const StageStats& stage : r.stats.stages)
        if (stage.name == "connect_vertices") return stage.items;
    return 0;
}

/// Fails unless `settings` render the same without lanes, to the bit.
void check_lanes(const Scene& scene, const RenderSettings& settings) {
    const RenderResult lanes = render_scene(scene, settings, 4);
    plain_lanes_off = true;
    const RenderResult scalar = render_scene(scene, settings, 4);
    plain_lanes_off = false;
    const std::vector<double>&a = lanes.film.sum, &b = scalar.film.sum;
    CHECK(*std::max_element(b.begin(), b.end()) > 0);
    CHECK(std::equal(a.begin(), a.end(), b.begin(), b.end()));
    CHECK(lanes.stats.invalid.total() == scalar.stats.invalid.total());
    CHECK(pairs_of(lanes) == pairs_of(scalar));
}

}  // namespace

TEST_CASE("Plain vertices in lanes render the image of vertices one by one") {
    if (!has_plain_lanes()) return skip("this processor has no lanes");
    for (const char* name : {"cornell", "glass", "materials", "lights", "textured", "furnace"})
        for (const Estimator estimator : {Estimator::nee, Estimator::mis}) {
            INFO(name << ", estimator " << int(estimator));
            const Scene scene = project_scene(name, 40, 36);
            RenderSettings settings = cpu_settings(scene, estimator);
            check_lanes(scene, settings);
            settings.max_depth = 3;
            settings.rr_depth = 2;
            settings.heuristic = MisHeuristic::power;
            check_lanes(scene, settings);
        }
}

TEST_CASE("Plain vertices in lanes are culled as others are") {
    if (!has_plain_lanes()) return skip("this processor has no lanes");
    const Scene scene = project_scene("cornell", 40, 36);
    RenderSettings settings = cpu_settings(scene, Estimator::mis);
    settings.cull = 0.1f;
    check_lanes(scene, settings);
}

TEST_CASE("Connections in lanes render the image of connections one by one") {
    if (!has_plain_lanes()) return skip("this processor has no lanes");
    for (const char* name : {"cornell", "glass", "materials", "lights", "textured"})
        for (const char* variant : {"wavefront", "lvc"}) {
            INFO(name << ", " << variant);
            const Scene scene = project_scene(name, 40, 36);
            RenderSettings settings = cpu_settings(scene, Estimator::mis);
            settings.integrator = "bdpt";
            settings.variant = variant;
            check_lanes(scene, settings);
            settings.max_depth = 4;
            settings.heuristic = MisHeuristic::power;
            settings.cull = 0.1f;
            check_lanes(scene, settings);
        }
}
