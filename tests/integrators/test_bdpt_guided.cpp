// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// bdpt whose subpaths are guided, of the eye, of light, or both: means are those of closed forms and of bdpt, whatever
// was learned and whatever strategies are off; what is learned depends on no thread; a stopped render goes on as it
// would have.
#include <cmath>

#include "integrators/offers.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/guided_settings.h"
#include "tests/support/guided_trees.h"

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

/// Eye rays that end in one place, learned one by one.
struct Arrivals {
    using Mis = GuidedMis<BidirectionalMis>;
    using Items = SubpathItems<Mis>;

    Scene scene = project_scene("cornell", 8, 8);
    test::Trees trees;
    GuideProgress eye{};
    WaveState at{};
    std::vector<Lane> lanes{LaneArray<HitItem<Items::Ray>>::kLanes};
    Wave wave{};

    explicit Arrivals(const GuidedSettings& settings) : trees(settings) {
        at.samples = 1;
        wave.state = &at;
        wave.width = wave.height = kTileSide;
        wave.tiles_x = wave.tiles = Divisor(1);
        wave.samples = 1;
        trees.state.progress->rounds = kGuideRounds;
    }
    void learn(uint32_t depth, Vec3f direction, float throughput, float over_pixel) {
        Subpath<Mis> path{};
        path.direction = direction;
        path.throughput = {throughput, throughput, throughput};
        path.sums.over_pixel = over_pixel;
        path.depth = at.depth = depth;
        const Queue<HitItem<Items::Ray>> hits = {{lanes.data(), 1}};
        // One that all decide to learn from.
        const uint32_t slot = GuideTraining{6, 1}.slot_of(wave, 0);
        hits.store(0, {Items::pack(path, Side::eye, slot, kInfinity), 0.25f, 0.25f, 0, 0});
        const LearnImportance<kAllFeatures, Mis> stage = {
            {wave, {0, 1}, trees.settings, trees.state, &trees.record}, scene.view(), hits, &eye};
        stage(0);
    }
};

}  // namespace

TEST_CASE("Importance is learned in the direction that it came from, by what its pixel is expected to be") {
    GuidedSettings settings;
    settings.filter = false;
    Arrivals arrivals(settings);
    const GuidedState& state = arrivals.trees.state;
    const Vec3f d = {0.6f, 0.0f, -0.8f};
    arrivals.eye.unit[uint32_t(GuideSum::radiance)] = 8 / LearnRecords::kMean;
    arrivals.learn(1, d, 2, 0);  // seen by the camera
    arrivals.learn(2 + GuideTraining::kDepths, d, 2, 0);
    CHECK(std::all_of(state.found, state.found + 4, [](int64_t n) { return n == 0; }));
    arrivals.learn(2, d, 2, 0);
    arrivals.learn(3, d, 2, 0.25f);  // a pixel half as bright as the mean
    const uint32_t cell = state.tree.quads.cell(0, square_of_direction(-d)).quadrant;
    for (uint32_t quadrant = 0; quadrant < 4; ++quadrant) {
        CHECK(state.found[quadrant] == (quadrant == cell ? 2 : 0));
        CHECK(state.sums[quadrant] == (quadrant == cell ? 2 + 4 : 0));
    }
}

TEST_CASE("Light subpaths follow the tree where importance does, and the BSDF where it has learned noise") {
    for (const bool noise : {false, true}) {
        GuidedSettings settings;
        settings.split = 1u << 20;
        Arrivals arrivals(settings);
        for (int k = 0; k < 2; ++k) {
            arrivals.trees.learn([&](uint32_t leaf) { arrivals.trees.put_light(leaf, 1000); });
            arrivals.trees.state.progress->rounds = kGuideRounds - 1;
        }
        arrivals.trees.state.progress->rounds = kGuideRounds;
        const GuideTree& tree = arrivals.trees.state.tree;
        CHECK(tree.leaves[0].bsdf_share == settings.bsdf_share);
        const Vec3f n = surface_at<kAllFeatures>(arrivals.scene.view(), 0, 0.25f, 0.25f).ng;
        for (uint32_t k = 0; k < 1000; ++k) {
            const Vec4f u = random_floats({5, k, 0, Stream::test}, 0);
            const Vec3f from = noise ? frame_from_normal(n).to_world(square_to_cosine_hemisphere({u.x, u.y}))
                                     : square_to_sphere(tree.quads.descend(0, {u.x, u.y}, true).at);
            arrivals.learn(2, -from, 1000, 0);
        }
        arrivals.trees.state.progress->rounds = kGuideRounds - 1;
        arrivals.trees.learn([](uint32_t) {});
        CHECK(tree.leaves[0].bsdf_share == GuideShares::of(noise ? GuideShares::kCount - 1 : 0));
    }
}

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
    for (const char* sides : kSides)
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
