// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: long
// timeout: 3600
// B32: vertices that almost coincide, over 10^8 samples, sample by sample against a bound.
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "tests/support/bidirectional_images.h"
#include "transport/mis/heuristic.h"

using namespace ambilux;

namespace {

constexpr double kAlbedo = 0.8;
constexpr int kDepth = 4;
constexpr uint32_t kSide = 1024;

/// The inside of a cube that glows everywhere with radiance 1, seen from next to one of its corners: most vertices of
/// eye subpaths lie in the three faces that meet there, and light subpaths begin in them too.
Scene glowing_corner() {
    return scene_from_text(scene_xml(
        kDepth, "<sensor type='perspective'><float name='fov' value='80'/><float name='near_clip' value='1e-4'/>" +
                    lookat("origin='-0.99,-0.985,-0.98' target='-1,-1,-1' up='0,1,0'") + film(kSide) +
                    "</sensor><shape type='cube'><boolean name='flip_normals' value='true'/>" +
                    diffuse({float(kAlbedo), float(kAlbedo), float(kAlbedo)}) + area_light({1, 1, 1}) + "</shape>"));
}

/// Every path of k segments that hits the light by itself has f / p = albedo^(k-1), as BSDF sampling of a diffuse
/// surface is exact. A weight of either heuristic is at most p_s p_0 / (p_s p_0 + p_0²) of strategy s's share of that,
/// so that what one strategy brings is at most albedo^(k-1), and there are k of them without light tracing.
double largest_sample() {
    double bound = 0;
    for (int k = 1; k <= kDepth; ++k) bound += k * std::pow(kAlbedo, k - 1);
    return bound;
}
double radiance() { return (1 - std::pow(kAlbedo, kDepth)) / (1 - kAlbedo); }

struct Seen {
    double largest = 0, mean = 0, error = 0;
};

Seen sample_by_sample(MisHeuristic heuristic, uint32_t samples) {
    const Scene scene = glowing_corner();
    RenderSettings s = method_settings(scene, {"hits+next_event+connections", heuristic}, 7);
    s.max_depth = kDepth;
    s.rr_depth = -1;
    const std::unique_ptr<Renderer> renderer = make_renderer(scene, s);
    Seen seen;
    double sum = 0, sum2 = 0, n = 0;
    for (uint32_t k = 0; k < samples; ++k) {
        renderer->clear_film();
        REQUIRE(renderer->render(k, 1) == 1);
        const FilmMoments f = renderer->film();
        for (size_t i = 0; i < f.sum.size(); i += 3) {
            seen.largest = std::max(seen.largest, f.sum[i]);
            sum += f.sum[i], sum2 += f.sum[i] * f.sum[i], n += 1;
        }
    }
    CHECK(renderer->stats().invalid.total() == 0);
    seen.mean = sum / n;
    seen.error = std::sqrt((sum2 / n - seen.mean * seen.mean) / n);
    std::printf("%s: %.3g samples, mean %.6f +- %.2g for %.6f, largest %.4f of %.4f\n",
                Heuristics::kNames[int(heuristic)], n, seen.mean, seen.error, radiance(), seen.largest,
                largest_sample());
    return seen;
}

}  // namespace

TEST_CASE("B32: no sample of 10^8 exceeds what the scene allows, where connected vertices nearly coincide") {
    for (const auto& [heuristic, samples] : {std::pair{MisHeuristic::balance, 96u}, {MisHeuristic::power, 16u}}) {
        const Seen seen = sample_by_sample(heuristic, samples);
        CHECK(seen.largest <= largest_sample() * (1 + 1e-4));
        // Points in one plane within rounding exchange no light, and rays begin above surfaces: 1e-5 of the light.
        CHECK(std::fabs(seen.mean - radiance()) < 4.5 * seen.error + 1e-5 * radiance());
        CHECK(seen.error < 1e-3 * radiance());
    }
}
