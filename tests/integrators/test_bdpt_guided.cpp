// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// bdpt whose subpaths are guided, of the eye, of light, or both: means are those of closed forms and of bdpt, whatever
// was learned and whatever strategies are off; what is learned depends on no thread; a stopped render goes on as it
// would have.
#include <cmath>

#include "integrators/offers.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/guided_settings.h"

using namespace ambilux;

namespace {

RenderSettings guided_bdpt(const Scene& scene, uint64_t seed, const SettingTexts& own = {}) {
    RenderSettings s = guided(scene, seed, own);
    s.integrator = "bdpt";
    return s;
}

Estimate lvc(const Scene& scene, uint32_t spp) {
    return render_batches(scene, method_settings(scene, {"all", MisHeuristic::balance, "lvc"}, 1001), spp);
}

constexpr const char* kSides[] = {"eye", "light", "both"};

}  // namespace

TEST_CASE("A plane under a sphere is as bright as its closed form says") {
    const Scene scene = plane_under(kSphereLight);
    const Image expected = plane_image(kLight, sphere_irradiance);
    for (const char* sides : kSides)
        for (const char* strategies : {"all", "hits", "hits+light"}) {
            INFO(sides << " " << strategies);
            const SettingTexts own = {{"guide_sides", sides}, {"strategies", strategies}, {"guide_samples", "2"}};
            check_image(scene, guided_bdpt(scene, 3, own), expected);
        }
}

TEST_CASE("A diffuse room, glass, and all materials have the expectation of bdpt") {
    for (const char* name : {"cornell", "glass", "materials"}) {
        INFO(name);
        Scene scene = project_scene(name, 32, 24);
        scene.integrator.hide_emitters = true;
        const Estimate truth = lvc(scene, 1024);
        for (const SettingTexts& own :
             std::vector<SettingTexts>{{},
                                       {{"guide_target", "moment"}, {"heuristic", "power"}},
                                       {{"guide_sides", "light"}},
                                       {{"guide_sides", "both"}, {"guide_target", "moment"}, {"rr_depth", "2"}}})
            check_agreement(scene, guided_bdpt(scene, 12, own), 1024, truth, 0.05);
    }
}

TEST_CASE("So has a strongly guided room whose strategies are off one group after the other") {
    const Scene scene = project_scene("cornell", 24, 24);
    const Estimate truth = lvc(scene, 1024);
    for (const char* sides : {"eye", "both"})
        for (const char* strategies : {"hits+next_event+connections", "hits+light+connections",
                                       "next_event+light+connections", "hits+next_event+light"}) {
            INFO(sides << " " << strategies);
            const SettingTexts own = {{"guide_sides", sides},
                                      {"strategies", strategies},
                                      {"guide_bsdf", "0.2"},
                                      {"guide_learn_bsdf", "false"},
                                      {"guide_roulette", "false"}};
            check_agreement(scene, guided_bdpt(scene, 13, own), 4096, truth, 0.05);
        }
}

TEST_CASE("What is learned depends on no thread, memory is predicted, and a stopped render goes on as it would have") {
    const Scene scene = project_scene("materials", 40, 24);
    for (const char* sides : kSides) {
        INFO(sides);
        const RenderSettings s = guided_bdpt(scene, 5, {{"guide_sides", sides}, {"deterministic", "true"}});
        const RenderResult one = render_on(1, scene, s, 12);
        for (const int threads : {2, 7}) check_same_bits(render_on(threads, scene, s, 12), one);
        CHECK(one.stats.memory_bytes == one.stats.memory_bytes_predicted);
        CHECK(one.stats.invalid.total() == 0);
        check_resumes_from_state(scene, s, one);
    }
}

TEST_CASE("Stages of their own add in another order, as those of lvc do, and change nothing else") {
    const Scene scene = project_scene("cornell", 32, 24);
    const auto films = [&](const SettingTexts& own) {
        RenderSettings s = guided_bdpt(scene, 6, own);
        const FilmMoments fused = render_scene(scene, s, 8).film;
        s.fuse = Fuse::none;
        return std::pair(fused, render_scene(scene, s, 8).film);
    };
    const auto [fused, apart] = films(
        {{"deterministic", "true"}, {"guide_bsdf", "1"}, {"guide_learn_bsdf", "false"}, {"guide_roulette", "false"}});
    for (size_t i = 0; i < fused.sum.size(); ++i) CHECK(apart.sum[i] == Approx(fused.sum[i]).epsilon(1e-5));
    // What a path brought after a vertex is a difference of sums, which rounds by a part of the sums: trees differ by
    // more than sums, by 1e-6, and paths that round into another cell part. Of 200 thousand choices (768 pixels of 8
    // samples, some five vertices of six levels) 0.2 do, each in one pixel: more than three pixels are not expected.
    const auto [one, other] = films({{"deterministic", "true"}});
    size_t part = 0;
    for (size_t i = 0; i < one.sum.size(); ++i) part += std::fabs(other.sum[i] / one.sum[i] - 1) > 1e-5;
    CHECK(part <= 9);
    CHECK(mean_of(other) == Approx(mean_of(one)).epsilon(1e-5));
}

TEST_CASE("Paths of few segments") {
    for (const int depth : {0, 1, 2, 3}) {
        const Scene scene = project_scene("cornell", 16, 16);
        RenderSettings s = guided_bdpt(scene, 5, {{"guide_sides", "both"}});
        s.max_depth = depth;
        CHECK(render_scene(scene, s, 8).stats.invalid.total() == 0);
    }
}

TEST_CASE("Training brings light to no image: one sample has the mean of many") {
    const Scene scene = project_scene("cornell", 64, 64);
    const double many = mean_of(render_scene(scene, guided_bdpt(scene, 5), 256).film);
    constexpr double kSeeds = 16;
    double sum = 0, squares = 0;
    for (uint64_t seed = 1; seed <= uint64_t(kSeeds); ++seed) {
        const double one = mean_of(render_scene(scene, guided_bdpt(scene, seed, {{"guide_samples", "1"}}), 1).film);
        sum += one, squares += one * one;
    }
    // 256 samples have a sixteenth of the variance of the 16 seeds' mean. Student's t of 15 degrees is below 6 but for
    // one test in 40 thousand.
    const double first = sum / kSeeds, variance = (squares / kSeeds - first * first) / (kSeeds - 1);
    CHECK(std::fabs(first - many) < 6 * std::sqrt(variance * (1 + 1.0 / 16)));
    CHECK(first == Approx(many).epsilon(0.03));
}
