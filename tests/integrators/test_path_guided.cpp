// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Path guiding: densities are those of what is sampled; the trees follow from what was recorded, not from threads,
// waves or where a render was stopped.
#include <fmt/format.h>

#include <cmath>

#include "integrators/offers.h"
#include "tests/support/chi_square.h"
#include "tests/support/guided_settings.h"
#include "tests/support/guided_trees.h"
#include "tests/support/whole_iterations.h"

using namespace ambilux;
using test::Trees;

TEST_CASE("Directions of the unit square are those of the sphere") {
    for (uint32_t i = 0; i < 10000; ++i) {
        const Vec4f u = random_floats({1, i, 0, Stream::test}, 0);
        const Vec2f at = square_of_direction(square_to_sphere({u.x, u.y}));
        CHECK(std::fabs(at.x - u.x) < 1e-6f);
        CHECK(std::min(std::fabs(at.y - u.y), 1 - std::fabs(at.y - u.y)) * std::sqrt(u.x * (1 - u.x)) < 1e-6f);
    }
    for (const Vec3f d : {Vec3f{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {1, -0.0f, 0}, {-1, 0, 0}, {0, -1, 0}}) {
        const Vec2f at = square_of_direction(d);
        CHECK((at.x >= 0 && at.x < 1 && at.y >= 0 && at.y < 1));
    }
}

TEST_CASE("A learned density integrates to one, and is that of what is sampled") {
    for (const GuideTarget target : {GuideTarget::radiance, GuideTarget::moment}) {
        GuidedSettings settings;
        settings.target = target;
        settings.split = 1u << 20;
        Trees trees(settings);
        for (int round = 0; round < 4; ++round) trees.learn([&](uint32_t leaf) { trees.put_light(leaf, 20000); });
        const GuideTree& tree = trees.state.tree;
        CHECK(trees.leaves() == 1);
        CHECK(tree.leaves[0].quads > 20);
        CHECK(tree.leaves[0].quads <= GuideQuads::kNodes);
        constexpr uint32_t kSide = 64, kSamples = 200'000;
        std::vector<double> observed(kSide * kSide), expected = observed;
        double whole = 0;
        uint32_t differ = 0;
        // Squares of side 2^-level, as small as the cells that they lie in.
        const auto add = [&](auto&& self, uint32_t x, uint32_t y, uint32_t level) -> void {
            const float side = GuideQuads::side(level);
            const GuideQuads::Cell cell = tree.quads.cell(0, {(float(x) + 0.5f) * side, (float(y) + 0.5f) * side});
            if (cell.level > level || level < 6) {
                for (uint32_t q = 0; q < 4; ++q) self(self, 2 * x + (q & 1), 2 * y + q / 2, level + 1);
                return;
            }
            const double mass = double(cell.density) * double(side) * double(side);
            whole += mass;
            expected[(y >> (level - 6)) * kSide + (x >> (level - 6))] += mass * kSamples;
        };
        add(add, 0, 0, 0);
        CHECK(whole == Approx(1).epsilon(1e-5));
        for (uint32_t i = 0; i < kSamples; ++i) {
            const Vec4f u = random_floats({2, i, 0, Stream::test}, 0);
            const GuideQuads::Cell sampled = tree.quads.descend(0, {u.x, u.y}, true);
            const Vec2f at = sampled.at;
            CHECK(sampled.density > 0);
            differ += std::fabs(tree.pdf_sa(0, square_to_sphere(at)) / (kInv4Pi * sampled.density) - 1) > 1e-5f;
            observed[uint32_t(at.y * kSide) * kSide + uint32_t(at.x * kSide)] += 1;
        }
        CHECK(differ < 20);  // rounded into another cell
        const test::ChiSquare test = test::chi_square(observed, expected);
        INFO("chi-square " << test.statistic << " of " << test.degrees);
        CHECK(test.p_value > 1e-4);
    }
}

TEST_CASE("Leaves split where many records are, as far as there is room, and their halves have the same quadtree") {
    for (const uint32_t most : {1u, 5u, 128u, 1000u}) {
        GuidedSettings settings;
        settings.split = 100;
        settings.most_leaves = most;
        Trees trees(settings);
        trees.learn([&](uint32_t leaf) { trees.put_light(leaf, 10000); });
        const GuideTree& tree = trees.state.tree;
        // About 7000 records. With little room twice as many as there is have to be in a leaf that splits.
        CHECK(trees.leaves() == (most == 1 ? 1u : most == 5 ? 2u : most == 128 ? 64u : 128u));
        for (uint32_t leaf = 0; leaf < trees.leaves(); ++leaf) {
            CHECK(tree.space[tree.leaves[leaf].node] == (GuideTree::kLeafBit | leaf));
            CHECK(1u << tree.leaves[leaf].depth == trees.leaves());
            for (const Vec3f d : {Vec3f{1, 0, 0}, {0, 0, 1}, {-1, 0, 0}})
                CHECK(tree.pdf_sa(leaf, d) == tree.pdf_sa(0, d));
        }
        std::vector<uint32_t> found(trees.leaves());
        for (uint32_t i = 0; i < 4096; ++i)
            ++found[tree.leaf({(i & 15) / 16.0f, (i >> 4 & 15) / 16.0f, (i >> 8) / 16.0f})];
        for (const uint32_t n : found) CHECK(n == 4096 / trees.leaves());
    }
}

TEST_CASE("What brought no light leaves the trees as they were") {
    Trees trees(GuidedSettings{});
    trees.learn([](uint32_t) {});
    CHECK(trees.state.tree.leaves[0].bsdf_share == 1.0f);
    trees.learn([&](uint32_t leaf) { trees.put(leaf, {0, 0, 1}, 5); });
    CHECK(trees.state.tree.leaves[0].bsdf_share == 0.5f);
    const float pdf = trees.state.tree.pdf_sa(0, {0, 0, 1});
    CHECK(pdf == Approx(4 * kInv4Pi * (1 + RefineQuads::kPrior) / (1 + 4 * RefineQuads::kPrior)));
    trees.learn([](uint32_t) {});
    CHECK(trees.state.tree.pdf_sa(0, {0, 0, 1}) == pdf);
}

TEST_CASE("What roulette goes by are means of what was recorded since the last update, and of all samples of a tile") {
    constexpr int64_t kWeight(LearnRecords::kWeight);
    Trees trees(GuidedSettings{});
    trees.state.progress->unit[uint32_t(GuideSum::radiance)] = 0.5f;
    for (const int64_t light : {3, 7}) {
        trees.learn([&](uint32_t leaf) {
            trees.put(leaf, {0, 0, 1}, 5);
            trees.state.reflected[0] += 8 * kWeight, trees.state.reflected[1] += 8 * light;
            trees.state.tiles[2] += 64 * kWeight, trees.state.tiles[3] += 64 * light;
        });
        CHECK(trees.state.tree.leaves[0].reflected == 0.5f * float(light));
    }
    CHECK(trees.state.over_pixel[0] == 0);  // nothing known
    CHECK(trees.state.over_pixel[1] == Approx(1 / 2.5));
}

TEST_CASE("Rays that roulette ended count in the mean of what rays bring, though they leave no record") {
    constexpr float kSurvival = 0.25f, kBrings = 2.0f;
    Trees trees(GuidedSettings{});
    GuideProgress& progress = *trees.state.progress;
    progress.unit[uint32_t(GuideSum::radiance)] = 0x1p-10f;
    progress.rounds = kGuideRounds;
    WaveState at{};
    at.samples = 1;
    Wave wave{};
    wave.state = &at;
    wave.width = wave.height = kTileSide;
    wave.tiles_x = wave.tiles = Divisor(1);
    wave.samples = 1;
    std::vector<Lane> samples(kTilePixels), places(2 * kTilePixels * GuideTraining::kDepths);
    std::vector<uint32_t> made(kTilePixels);
    const GuideTraining training = {0, 1};
    const GuideRecords records = {{places.data(), kTilePixels * GuideTraining::kDepths}, made.data()};
    for (uint32_t slot = 0; slot < kTilePixels; slot += 4) {
        made[slot] = 1;
        records.of_vertices.store(training.place(slot), {0, 0, kInv4Pi, 0.0f, 0.5f, 0.5f, kSurvival, 0});
        const float brought = 0.5f * kBrings / kSurvival;
        set_start(samples[slot], Rgb{brought, brought, brought});
    }
    const LearnRecords learn = {{wave, training, trees.settings, trees.state, &trees.record}, records, samples.data()};
    for (uint32_t group = 0; group < kTilePixels; ++group) learn(group);
    trees.learn([&](uint32_t leaf) { trees.put(leaf, {0, 0, 1}, 5); });
    CHECK(trees.state.tree.leaves[0].reflected == Approx(kBrings));
}

TEST_CASE("Iterations follow the size of the film and how many samples there will be") {
    const Scene scene = project_scene("cornell", 64, 64);
    RenderSettings s = guided(scene, 5, {{"guide_samples", "0"}, {"guide_leaves", "16"}});
    using Case = std::pair<uint32_t, uint32_t>;
    for (const auto& [samples, expected] : {Case{0, 64}, Case{64, 8}, Case{60, 4}, Case{7, 1}, Case{4096, 64}}) {
        s.expected_samples = samples;
        CHECK(make_renderer(scene, s)->iteration_samples() == expected);
    }
}

TEST_CASE("A leaf takes the share of the BSDF with which its records would have had the least second moment") {
    GuidedSettings settings;
    for (const bool learns : {true, false}) {
        settings.learn_share = learns;
        Trees trees(settings);
        const auto record = [&](uint32_t leaf) {
            trees.put_light(leaf, 100);
            for (uint32_t k = 0; k < GuideShares::kCount; ++k)
                trees.state.shares[leaf * GuideShares::kCount + k] = k == 6 ? 10 : 20;
        };
        trees.learn(record);
        CHECK(trees.state.tree.leaves[0].bsdf_share == settings.bsdf_share);  // nothing was guided yet
        trees.learn(record);
        CHECK(trees.state.tree.leaves[0].bsdf_share == (learns ? GuideShares::of(6) : settings.bsdf_share));
    }
}

TEST_CASE("What is learned depends on no thread and no size of waves, and a stopped render goes on as it would have") {
    const Scene scene = project_scene("materials", 40, 24);
    const RenderSettings s = guided(scene, 5);
    const RenderResult one = render_on(1, scene, s, 12);
    for (const int threads : {2, 7}) check_same_bits(render_on(threads, scene, s, 12), one);
    for (const uint32_t wave_size : {64u, 4096u}) {
        RenderSettings other = s;
        other.wave_size = wave_size;
        check_same_bits(render_scene(scene, other, 12), one);
    }
    CHECK(one.stats.memory_bytes == one.stats.memory_bytes_predicted);
    CHECK(one.stats.invalid.total() == 0);
    check_resumes_from_state(scene, s, one);
}

TEST_CASE("Paths of few segments") {
    for (const int depth : {0, 1, 2, 3}) {
        const Scene scene = project_scene("cornell", 16, 16);
        RenderSettings s = guided(scene, 5);
        s.max_depth = depth;
        CHECK(render_scene(scene, s, 8).stats.invalid.total() == 0);
    }
}

TEST_CASE("Units of light and of length change nothing that is learned") {
    const auto room = [](double size, double radiance) {
        return scene_from_text(fmt::format(
            "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='5'/></integrator>"
            "<sensor type='perspective'><float name='fov' value='50'/><float name='near_clip' value='{0}'/><transform "
            "name='to_world'><lookat origin='0,{1},0' target='0,0,0' up='0,0,1'/></transform><film type='hdrfilm'>"
            "<integer name='width' value='24'/><integer name='height' value='24'/><rfilter type='box'/></film></sensor>"
            "<shape type='cube'><transform name='to_world'><scale value='{2}'/></transform><bsdf type='twosided'>"
            "<bsdf type='diffuse'/></bsdf></shape><shape type='rectangle'><transform name='to_world'><scale "
            "value='{3}'/><translate z='{4}'/></transform><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></shape>"
            "<shape type='rectangle'><transform name='to_world'><scale value='{5}'/><translate z='{6}'/></transform>"
            "<emitter type='area'><rgb name='radiance' value='{7}'/></emitter></shape></scene>",
            0.001 * size, 0.9 * size, size, 0.5 * size, 0.5 * size, 0.3 * size, 0.7 * size, radiance));
    };
    for (const char* integrator : {"path", "bdpt"}) {
        const auto mean = [&](double size, double radiance) {
            const Scene scene = room(size, radiance);
            RenderSettings s = guided(scene, 7);
            s.integrator = integrator;
            if (s.integrator == "bdpt") apply_setting(s, "guide_sides", "both");
            const RenderResult r = render_scene(scene, s, 16);
            CHECK(r.stats.invalid.total() == 0);
            return mean_of(r.film) / radiance;
        };
        INFO(integrator);
        const double usual = mean(1, 1);
        CHECK(usual > 0);
        CHECK(mean(1, 0x1p-33) == Approx(usual).epsilon(1e-3));  // about 1e-10
        for (const double size : {1e-3, 1e3}) CHECK(mean(size, 1) == Approx(usual).epsilon(0.05));
    }
}
