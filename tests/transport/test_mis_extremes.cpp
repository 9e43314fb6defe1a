// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 60
// Weights of densities that are very large or very small (B28), and of renders without light subpaths (B27).
#include <cmath>
#include <random>

#include "core/math.h"
#include "scene/scene.h"
#include "tests/support/catch.h"
#include "transport/mis/bidirectional.h"
#include "transport/mis/unidirectional.h"

using namespace ambilux;

namespace {

/// Without masks: there are no emitters to ask for their opacity.
constexpr Features kOpaque = [] {
    Features f = kAllFeatures;
    f.opacity = false;
    return f;
}();

constexpr MisHeuristic kHeuristics[] = {MisHeuristic::balance, MisHeuristic::power};

double beta(MisHeuristic h) { return h == MisHeuristic::power ? 2.0 : 1.0; }

/// Every third power of ten from 1e-30 to 1e30, and what lies next to one.
std::vector<float> magnitudes() {
    std::vector<float> m = {0.999999f, 1.000001f, 3.0f, 0.3f};
    for (int e = -30; e <= 30; e += 3) m.push_back(std::pow(10.0f, float(e)));
    return m;
}

/// Weight of p against q in double precision, which holds the square of 1e60.
double true_weight(MisHeuristic h, double p, double q) { return 1 / (1 + std::pow(q / p, beta(h))); }

}  // namespace

TEST_CASE("B28: weights of two strategies lie in [0,1], sum to one and are right from 1e-30 to 1e30") {
    for (const MisHeuristic h : kHeuristics)
        for (const float p : magnitudes())
            for (const float q : magnitudes()) {
                INFO(Heuristics::kNames[int(h)] << " " << p << " " << q);
                const UnidirectionalMis mis{Estimator::mis, h, true};
                EmitterSample light{};
                light.pdf_sa = p;
                BsdfValue f{};
                f.pdf_sa = q;
                const float next_event = mis_weight(mis.next_event_ratio<kOpaque>({}, 1.0f, {}, false, light, f, 1.0f));
                float ratio = -1;
                REQUIRE(mis.ratio_to({q}, p, ratio));
                const float hit = mis_weight(ratio);
                for (const float w : {next_event, hit}) {
                    REQUIRE(w >= 0);
                    REQUIRE(w <= 1);
                }
                // Four roundings of a float, doubled by the square.
                REQUIRE(std::fabs(double(next_event) - true_weight(h, p, q)) <= 8 * 0x1p-24);
                REQUIRE(std::fabs(double(hit) - true_weight(h, q, p)) <= 8 * 0x1p-24);
                REQUIRE(std::fabs(double(next_event) + double(hit) - 1) <= 8 * 0x1p-24);
            }
}

namespace {

/// Sums and densities of both ends of a connection whose neighbours are diffuse: what a path of four segments has,
/// with all densities drawn over `decades` powers of ten on either side of 1.
struct Connected {
    MisSums y, z;
    ConnectionDensities p;
};

Connected random_ends(std::mt19937& rng, float decades) {
    std::uniform_real_distribution<float> exponent(-decades, decades);
    const auto draw = [&] { return std::pow(10.0f, exponent(rng)); };
    return {{draw(), draw()}, {draw(), draw()}, {draw(), draw(), draw(), draw()}};
}

double true_ratio(const Connected& c, const BidirectionalMis& mis) {
    const double b = beta(mis.heuristic), k = std::pow(double(mis.connections), b);
    const auto side = [&](MisSums s, float area, float reverse) {
        return std::pow(double(area), b) *
               (k * std::pow(double(s.dvcm), b) + std::pow(double(s.dvc) * double(reverse), b));
    };
    return (side(c.y, c.p.y_area, c.p.y_reverse_sa) + side(c.z, c.p.z_area, c.p.z_reverse_sa)) / k;
}

}  // namespace

TEST_CASE("B28: weights of connections are right where their densities differ by many powers of ten") {
    std::mt19937 rng(5);
    for (const MisHeuristic h : kHeuristics)
        // A product of three densities must be a float: as far as that goes.
        for (const float decades : {3.0f, 6.0f, 12.0f})
            for (const float connections : {1.0f, 0.01f, 40.0f})
                for (int i = 0; i < 20000; ++i) {
                    const BidirectionalMis mis{h, kAllStrategies, 1000.0f, connections};
                    const Connected c = random_ends(rng, decades);
                    const float w = mis_weight(mis.connection_ratio(c.y, false, c.z, false, c.p));
                    const double truth = 1 / (1 + true_ratio(c, mis));
                    if (!(w >= 0 && w <= 1 && std::fabs(double(w) - truth) <= 1e-6 * truth + 1e-34))
                        FAIL(Heuristics::kNames[int(h)] << ", 1e" << decades << ": " << w << " for " << truth);
                }
}

TEST_CASE("B28: sums along a subpath over tiny and huge scenes keep the ratios of a scene of size one") {
    // Densities per area scale by 1/size², those per solid angle do not: a weight must not change.
    for (const MisHeuristic h : kHeuristics) {
        const BidirectionalMis mis{h, kAllStrategies, 4096.0f, 1.0f};
        const auto weight = [&](float size) {
            MisSums y = {0.3f, 0.1f * sqr(size)}, z = {0.2f, 0.0f};
            for (int k = 0; k < 5; ++k)
                for (MisSums* s : {&y, &z}) {
                    *s = mis.sums_at_hit(*s, sqr(size) * (0.5f + float(k)), 0.4f, false);
                    *s = mis.sums_after_scatter(*s, false, false, 0.3f, 0.25f, 0.6f);
                }
            y = mis.sums_at_hit(y, sqr(size), 0.4f, false), z = mis.sums_at_hit(z, sqr(size), 0.7f, false);
            const float per_area = 0.2f / sqr(size);
            return mis_weight(mis.connection_ratio(y, false, z, false, {per_area, 0.3f, per_area, 0.1f}));
        };
        for (const float size : {0x1p-30f, 0x1p-12f, 0x1p12f, 0x1p30f}) {
            INFO(Heuristics::kNames[int(h)] << ", size " << size);
            CHECK(weight(1) > 0);
            CHECK(weight(1) < 1);
            CHECK(weight(size) == Approx(weight(1)).epsilon(1e-5));
        }
    }
}

TEST_CASE("next event estimation alone leaves it all that it can find, however thinly") {
    const UnidirectionalMis nee{Estimator::nee, MisHeuristic::balance, true};
    for (const float p : magnitudes()) {
        float ratio = -1;
        CHECK_FALSE(nee.ratio_to({1.0f}, p, ratio));
    }
    float ratio = -1;
    CHECK(nee.ratio_to({1.0f}, 0.0f, ratio));
    CHECK(ratio == 0);
}

TEST_CASE("B27: without a light subpath strategies that need one have no weight, and the others finite ones") {
    Scene scene;
    Emitter lamp{};
    lamp.type = EmitterType::point;
    lamp.pick_probability = 1;
    scene.emitters.push_back(lamp);
    scene.sensor.type = SensorType::perspective;
    scene.sensor.tan_half_fov = {0.5f, 0.5f};
    scene.sensor.film_width = scene.sensor.film_height = 16;
    for (int i = 0; i < 3; ++i) scene.sensor.to_world.m[i][i] = 1;
    const SceneView view = scene.view();
    for (const MisHeuristic h : kHeuristics) {
        INFO(Heuristics::kNames[int(h)]);
        const BidirectionalMis none{h, kAllStrategies, 0.0f, 0.0f};
        MisSums eye;
        SubpathStart start;
        none.start_eye<kAllFeatures>(view, {0, 0, 1}, eye, start);
        CHECK(eye.dvcm == 0);
        for (int k = 0; k < 3; ++k) {
            eye = none.sums_at_hit(eye, 2.0f, 0.5f, false);
            eye = none.sums_after_scatter(eye, k == 0, false, 0.3f, 0.2f, 0.6f);
            CHECK(std::isfinite(eye.dvcm));
            CHECK(std::isfinite(eye.dvc));
        }
        CameraConnection camera{};
        camera.cos_camera = 0.9f, camera.camera_distance = 2;
        const MisSums light = {0.4f, 0.7f};
        CHECK(mis_weight(none.camera_ratio<kAllFeatures>(view, light, true, camera, 0.5f, 0.2f)) == 0);
        CHECK(mis_weight(none.visible_emitter_ratio<kAllFeatures>(view, camera, 0.5f, 0.3f, 1.0f)) == 0);
        EmitterSample sample{};
        sample.pdf_sa = 1, sample.distance = 2, sample.delta = true, sample.wi = {0, 0, 1};
        BsdfValue f{};
        f.pdf_sa = 0.3f, f.pdf_reverse_sa = 0.2f;
        const float w = mis_weight(none.next_event_ratio<kAllFeatures>(view, 1.0f, eye, false, sample, f, 0.5f));
        CHECK(w > 0);
        CHECK(w <= 1);
    }
}
