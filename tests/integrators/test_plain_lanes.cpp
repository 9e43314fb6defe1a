// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_core
// timeout: 120
// Plain vertices of path in lanes (backends/cpu/plain_lanes.h) against the same render without fusion, which has none.
#include <algorithm>

#include "backends/cpu/plain_vertices.h"
#include "tests/support/render_scene.h"

using namespace ambilux;

namespace {

/// Fails unless `settings` render what they do with fuse=none, to the bit.
void check_lanes(const Scene& scene, RenderSettings settings) {
    settings.specialise = false;  // only the level of all features has kernels without fusion
    const RenderResult lanes = render_scene(scene, settings, 4);
    settings.fuse = Fuse::none;
    const RenderResult scalar = render_scene(scene, settings, 4);
    const std::vector<double>&a = lanes.film.sum, &b = scalar.film.sum;
    CHECK(*std::max_element(b.begin(), b.end()) > 0);
    CHECK(std::equal(a.begin(), a.end(), b.begin(), b.end()));
    CHECK(lanes.stats.invalid.total() == scalar.stats.invalid.total());
}

}  // namespace

TEST_CASE("Plain vertices in lanes render the image of vertices one by one") {
    if (!has_plain_lanes()) return skip("this processor has no vectors of 16 floats");
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
    if (!has_plain_lanes()) return skip("this processor has no vectors of 16 floats");
    const Scene scene = project_scene("cornell", 40, 36);
    RenderSettings settings = cpu_settings(scene, Estimator::mis);
    settings.cull = 0.1f;
    check_lanes(scene, settings);
}
