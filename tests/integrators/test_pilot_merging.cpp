// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// bdpt.auto=true: light that hits alone find is known to the pilot before any render meets it.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/rng.h"
#include "integrators/auto/nearest.h"
#include "render/selection.h"
#include "tests/support/bidirectional_images.h"

using namespace ambilux;

TEST_CASE("the nearest points are those of a search through all, on planes and lines too") {
    constexpr size_t kNearest = 8;
    for (const int dimensions : {1, 2, 3}) {
        std::vector<Vec3f> points;
        for (uint32_t i = 0; i < 500; ++i) {
            const Uint4 bits = random_bits({1, i, 0, Stream::eye}, 0);
            const auto place = [&](uint32_t b, int k) { return k < dimensions ? float(b % 4096u) / 4096.0f : 0.5f; };
            points.push_back({place(bits.x, 0), place(bits.y, 1), place(bits.z, 2)});
        }
        const NearestPoints tree(points);
        for (uint32_t q = 0; q < 100; ++q) {
            const Uint4 bits = random_bits({2, q, 0, Stream::eye}, 0);
            const Vec3f p = {float(bits.x % 1000u) / 900.0f, float(bits.y % 1000u) / 900.0f,
                             float(bits.z % 1000u) / 900.0f};
            std::vector<float> all;
            for (const Vec3f& a : points) all.push_back(length_squared(a - p));
            std::sort(all.begin(), all.end());
            auto found = tree.nearest<kNearest>(p);
            CHECK(found[0].first == all[kNearest - 1]);
            std::sort(found.begin(), found.end());
            for (size_t k = 0; k < kNearest; ++k) {
                CHECK(found[k].first == all[k]);
                CHECK(length_squared(points[found[k].second] - p) == found[k].first);
            }
        }
    }
}

TEST_CASE("a caustic seen in a mirror: its noise is predicted from light vertices, for all candidates alike") {
    // The camera sees the ground in a mirror only. The glass ball gathers the lamp's light there: lamp, glass, glass,
    // ground, mirror, camera is found by hits alone.
    const Scene scene = scene_from_text(scene_xml(
        6,
        "<sensor type='perspective'><float name='fov' value='30'/>" +
            lookat("origin='0,-1,1.2' target='0,1.5,1.2' up='0,0,1'") + film(32) +
            "</sensor><shape type='rectangle'><transform name='to_world'><scale value='2'/></transform>" +
            diffuse({0.5f, 0.5f, 0.5f}) +
            "</shape><shape type='rectangle'><transform name='to_world'><scale value='2'/><rotate x='1' angle='125'/>"
            "<translate y='1.5' z='1.2'/></transform><bsdf type='conductor'/></shape>"
            "<shape type='sphere'><point name='center' x='0' y='0.2' z='0.45'/><float name='radius' value='0.3'/><bsdf "
            "type='dielectric'/></shape><shape type='sphere'><point name='center' x='0' y='0.2' z='2.2'/><float "
            "name='radius' value='0.15'/>" +
            diffuse({0, 0, 0}) + area_light({30, 30, 30}) + "</shape>"));
    RenderSettings s = cpu_settings(scene, Estimator::mis, 1);
    s.integrator = "bdpt";
    s.automatic = true;
    const std::vector<SelectionCandidate> candidates = selection_candidates(s, false);
    std::vector<PilotCandidate> pilots;
    for (const SelectionCandidate& c : candidates) pilots.push_back(c.pilot);
    SharedAccels accels(scene);
    constexpr int kSeeds = 8;
    std::vector<double> predicted;
    for (int seed = 1; seed <= kSeeds; ++seed) {
        s.seed = uint64_t(seed);
        s.expected_samples = 1u << 20;
        const Pilot pilot = run_pilot(scene, s, false, false, accels, pilots, 8192);
        double sum = 0;
        for (const double v : pilot.variance[0]) sum += v;
        predicted.push_back(sum / double(pilot.variance[0].size()));
    }
    // The path tracer's own variance, relative to the means of blocks as the pilot has them.
    RenderSettings path = cpu_settings(scene, Estimator::mis, 77);
    const FilmMoments f = render_scene(scene, path, 1024).film;
    double measured = 0;
    constexpr uint32_t kBlock = 4, kBlocks = 32 / kBlock;
    for (uint32_t y = 0; y < 32; ++y)
        for (uint32_t x = 0; x < 32; ++x) {
            const auto edge = [](uint32_t b, bool end) {
                return end ? std::min(32u, (b + 2) * kBlock) : (b ? b - 1 : 0) * kBlock;
            };
            const uint32_t x0 = edge(x / kBlock, false), x1 = edge(x / kBlock, true), y0 = edge(y / kBlock, false),
                           y1 = edge(y / kBlock, true);
            double mean = 0;
            for (uint32_t j = y0; j < y1; ++j)
                for (uint32_t i = x0; i < x1; ++i) mean += f.mean((size_t(j) * 32 + i) * 3) / ((x1 - x0) * (y1 - y0));
            measured += f.variance((size_t(y) * 32 + x) * 3) / (mean * mean + 0.01) / (32 * 32);
        }
    static_assert(kBlocks * kBlock == 32);
    double mean = 0, squares = 0;
    for (const double p : predicted) mean += p / kSeeds;
    for (const double p : predicted) squares += (p - mean) * (p - mean);
    const double error = std::sqrt(squares / (kSeeds - 1) / kSeeds);
    INFO("predicted " << mean << " +- " << error << ", measured " << measured);
    // A density estimate blurs: within a factor.
    CHECK(mean > measured / 1.6);
    CHECK(mean < measured * 1.6);
    CHECK(error < 0.1 * mean);
}

TEST_CASE("what connections find behind a mirror counts as it is found, though there is light that hits alone find") {
    // The lamp shines at the ceiling, and the camera sees the ground in a mirror. A small dark ball over the lamp
    // reflects next to none of the light, but many light subpaths.
    const auto scene_with = [](const std::string& ball) {
        return scene_from_text(scene_xml(
            4, "<sensor type='perspective'><float name='fov' value='30'/>" +
                   lookat("origin='0,-1,1.2' target='0,1.5,1.2' up='0,0,1'") + film(16) +
                   "</sensor><shape type='rectangle'><transform name='to_world'><scale value='2'/></transform>" +
                   diffuse({0.5f, 0.5f, 0.5f}) +
                   "</shape><shape type='rectangle'><transform name='to_world'><scale value='2'/><rotate x='1' "
                   "angle='180'/><translate z='3'/></transform>" +
                   diffuse({0.8f, 0.8f, 0.8f}) +
                   "</shape><shape type='rectangle'><transform name='to_world'><scale value='1'/><rotate x='1' "
                   "angle='125'/><translate y='1.5' z='1.2'/></transform><bsdf type='conductor'/></shape>"
                   "<shape type='rectangle'><transform name='to_world'><scale value='0.3'/><translate y='0.2' z='2.5'/>"
                   "</transform>" +
                   diffuse({0, 0, 0}) + area_light({30, 30, 30}) + "</shape>" + ball));
    };
    const Scene without = scene_with(""),
                with = scene_with(
                    "<shape type='sphere'><point name='center' x='0.1' y='0.2' z='2.7'/><float name='radius' "
                    "value='0.03'/><bsdf type='conductor'><string name='material' value='none'/><rgb "
                    "name='specular_reflectance' value='0.01,0.01,0.01'/></bsdf></shape>");
    const auto predicted = [](const Scene& scene) {
        RenderSettings s = cpu_settings(scene, Estimator::mis, 1);
        s.integrator = "bdpt";
        s.automatic = true;
        s.expected_samples = 1u << 10;
        std::vector<PilotCandidate> pilots;
        for (const SelectionCandidate& c : selection_candidates(s, false)) pilots.push_back(c.pilot);
        SharedAccels accels(scene);
        const Pilot pilot = run_pilot(scene, s, false, false, accels, pilots, 16384);
        std::vector<double> sums;
        for (const std::vector<double>& of : pilot.variance)
            sums.push_back(std::accumulate(of.begin(), of.end(), 0.0) / double(of.size()));
        return sums;
    };
    const std::vector<double> a = predicted(without), b = predicted(with);
    REQUIRE(a.size() == b.size());
    for (size_t c = 0; c < a.size(); ++c) {
        CAPTURE(c);
        CHECK(a[c] > 0);
        CHECK(b[c] == Approx(a[c]).epsilon(0.1));
    }
}
