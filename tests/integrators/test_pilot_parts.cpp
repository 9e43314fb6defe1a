// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// What the pilot of bdpt.auto=true is made of: weights of three sets of strategies, light from vertices nearby, and
// what splats count for.
#include <map>
#include <tuple>

#include "accel/embree_tracer.h"
#include "core/rng.h"
#include "integrators/auto/film_footprint.h"
#include "integrators/auto/merging.h"
#include "integrators/auto/pilot_mis.h"
#include "integrators/auto/variance_prediction.h"
#include "integrators/bdpt/shared/policy.h"
#include "tests/support/bidirectional_images.h"
#include "transport/subpath/camera_connection.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/start.h"
#include "transport/subpath/trace.h"

using namespace ambilux;

namespace {

/// By subpath, s and t.
template <class Mis>
using Ratios = std::map<std::tuple<uint32_t, uint32_t, uint32_t>, typename Mis::Ratio>;

template <class Mis>
struct RatioSink {
    const SceneView& scene;
    const Rules<Mis>& rules;
    uint32_t index;
    RandomNumbers subpath_numbers;
    Ratios<Mis>& ratios;
    std::vector<SubpathEnd<Mis>>& light;
    Side side;

    RandomNumbers numbers() const { return subpath_numbers; }
    bool valid(Rgb throughput) const { return is_valid_radiance(throughput); }
    void add(const Candidate<Mis>& c) const { ratios[{index, c.strategy.s(), c.strategy.t()}] = c.ratio; }
    void at(const Vertex<Mis>& v, const Subpath<Mis>& path, const RandomNumbers& numbers) const {
        Candidate<Mis> c;
        const SubpathEnd<Mis> end = {v, path.throughput, path.depth};
        if (side == Side::light) {
            const Vec4f u = numbers.lens(path.depth);
            if (camera_connection<kAllFeatures>(scene, rules, v, path.throughput, path.depth, {u.x, u.y}, c)) add(c);
            light.push_back(end);
            return;
        }
        if (next_event<kAllFeatures>(scene, rules, v, path.throughput, path.depth, numbers.next_event(path.depth), c))
            add(c);
        for (const SubpathEnd<Mis>& y : light)
            if (connection<kAllFeatures>(rules, end, y, c)) add(c);
    }
};

/// What a hundred eye subpaths and light subpaths find, whether their ways are free or not.
template <class Mis>
Ratios<Mis> ratios_of(const Scene& scene, const Rules<Mis>& rules) {
    const SceneView view = scene.view();
    const EmbreeAccel accel(scene);
    const EmbreeTracer tracer = accel.tracer();
    Ratios<Mis> ratios;
    for (uint32_t i = 0; i < 100; ++i) {
        std::vector<SubpathEnd<Mis>> light;
        for (const Side side : {Side::light, Side::eye}) {
            const RandomNumbers numbers = {{3, i, side == Side::light ? 1u : 0u, Stream::test}};
            const RatioSink<Mis> sink = {view, rules, i, numbers, ratios, light, side};
            float tmax = kInfinity;
            Subpath<Mis> first;
            EmissionSample e;
            if (side == Side::eye)
                first = start_eye_subpath<kAllFeatures>(view, rules.mis, i % 16, i / 16, numbers, tmax);
            else if (!start_light_subpath<kAllFeatures>(view, rules, numbers, sink, e, first))
                continue;
            const auto extend = [&](const Subpath<Mis>& path, float at_most) {
                return end_of_ray<kAllFeatures>(view, tracer, path, at_most, numbers);
            };
            trace_subpath<kAllFeatures>(view, rules, side, rules.longest(side), first, tmax, extend, sink);
        }
    }
    return ratios;
}

}  // namespace

TEST_CASE("weights of three sets of strategies along one subpath are those of each set alone") {
    Scene scene = project_scene("lights", 16, 16);
    RenderSettings s = cpu_settings(scene, Estimator::mis);
    s.integrator = "bdpt";
    s.max_depth = 5;
    Rules<BidirectionalMis> rules = plan_bdpt(scene, s).rules;
    const PilotMis three(rules.mis);
    const Ratios<PilotMis> together = ratios_of(scene, plan_bdpt<PilotMis>(scene, s).rules);
    CHECK(three.light_subpaths == rules.mis.light_subpaths);
    for (uint32_t m = 0; m < PilotMis::kSets; ++m) {
        rules.mis = three.sets[m];
        const Ratios<BidirectionalMis> alone = ratios_of(scene, rules);
        std::map<std::pair<uint32_t, uint32_t>, int> found;
        for (const auto& [key, ratio] : alone) {
            const auto& [index, s_of, t_of] = key;
            INFO("set " << m << ", subpath " << index << ", s" << s_of << "t" << t_of);
            REQUIRE(together.contains(key));
            const PilotMis::Ratio& all = together.at(key);
            if (s_of >= 2 && t_of >= 2 && !rules.mis.has(kConnectionStrategies)) {
                // None of theirs: the others follow from fewer strategies.
                CHECK(all.of[m] <= all.of[2]);
                continue;
            }
            CHECK(all.of[m] == Approx(ratio).epsilon(1e-5));
            if (ratio > 0.0f) ++found[{std::min(s_of, 2u), std::min(t_of, 2u)}];
        }
        // Hits, next event estimation, light tracing and connections, each of which others sample too.
        CHECK(found[{0, 2}] > 20);
        CHECK(found[{1, 2}] > 20);
        CHECK(found[{2, 1}] > 20);
        CHECK((found[{2, 2}] > 20) == (m == 2));
    }
    CHECK(three.sets[0].strategies == (kHitStrategies | kNextEventStrategies));
    CHECK(three.sets[1].strategies == (kHitStrategies | kNextEventStrategies | kLightStrategies));
    CHECK(three.sets[2].strategies == kAllStrategies);
}

TEST_CASE("light near an eye vertex is that of vertices on its surface that hits alone find, in paths not too long") {
    constexpr float kAlbedo = 0.5f, kDvc = 2.0f;
    constexpr uint32_t kSubpaths = 1000;
    const Scene scene = scene_from_text(
        scene_xml(6, "<sensor type='perspective'>" + film(4) + "</sensor><shape type='rectangle'>" +
                         "<bsdf type='twosided'>" + diffuse({kAlbedo, kAlbedo, kAlbedo}) + "</bsdf>" + "</shape>"));
    const SceneView view = scene.view();
    using End = SubpathEnd<PilotMis>;
    const auto end = [&](float x, float cosine, uint32_t depth, float throughput) {
        SurfacePoint point = surface_at<kAllFeatures>(view, 0, 0.25f, 0.25f);
        point.p = {x, 0, 0};
        const float height = fabsf(cosine);
        const Vec3f wi = {sqrtf(1 - height * height), 0, cosine};
        PilotMis::Sums sums = {};
        for (MisSums& m : sums.of) m = {0, kDvc};
        return End{
            vertex_with<kAllFeatures, PilotMis>(view, -wi, depth, point, sums), {throughput, 2 * throughput, 0}, depth};
    };
    BidirectionalMis mis{};
    mis.strategies = kAllStrategies;
    mis.connections = mis.light_subpaths = 1;
    std::vector<End> ends = {end(0.1f, 0.8f, 2, 1),   end(0.2f, 0.6f, 4, 2),   end(0.3f, 0.5f, 5, 4),
                             end(0.4f, 0.5f, 2, 8),   end(0.5f, 1, 3, 16),     end(0.6f, 5e-4f, 2, 32),
                             end(0.7f, -0.8f, 2, 64), end(0.8f, 0.5f, 2, 128), end(5, 1, 2, 256),
                             end(0.01f, 1, 1, 512),   end(0.02f, 1, 2, 1024),  end(0.03f, 1, 2, 2048),
                             end(0.04f, 1, 2, 4096)};
    for (MisSums& m : ends[0].vertex.sums.of) m.dvc = 1e-3f;
    ends[3].vertex.point.ng = {0.8f, 0, 0.6f};  // around an edge
    ends[4].vertex.point.ng = {0.6f, 0, 0.8f};
    ends[7].vertex.sums.of[2].dvcm = 0.9e-4f * kDvc;        // connections find it too, as cosines are
    for (MisSums& m : ends[10].vertex.sums.of) m = {0, 0};  // hits do not find it
    ends[11].vertex.sums.of[2].dvcm = 1.005e-4f * kDvc;     // connections do
    ends[12].vertex.sums.of[1].dvc = ends[12].vertex.sums.of[2].dvc = 2 * kDvc;
    std::vector<const End*> all;
    for (const End& e : ends) all.push_back(&e);
    const HitsOnlyLight<kAllFeatures> light(PilotMis(mis), all, kSubpaths);
    CHECK(light.any());
    CHECK_FALSE(HitsOnlyLight<kAllFeatures>(PilotMis(mis), {all.begin(), all.begin() + 7}, kSubpaths).any());

    End z = end(0, 0.9f, 2, 0.5f);
    const double paths = M_PI * 0.64 * kSubpaths * 8 / 7;
    std::map<size_t, std::pair<Rgb, float>> added;  // by the light vertex
    light.at(z, 6, [&](Rgb value, float ratio) {
        const double throughput = double(value.x) * paths * M_PI / (0.5 * kAlbedo);
        size_t k = 0;
        while (k < ends.size() && std::abs(throughput - double(1u << k)) > 0.01 * double(1u << k)) ++k;
        REQUIRE(k < ends.size());
        CHECK(added.emplace(k, std::pair(value, ratio)).second);
    });
    CHECK(added.size() == 3);
    for (const auto& [k, cosine] : {std::pair{0u, 0.8}, {1u, 0.6}, {4u, 1.0}}) {
        CAPTURE(k);
        REQUIRE(added.contains(k));
        const auto& [value, ratio] = added.at(k);
        CHECK(value.x == Approx((1 << k) * 0.5 * kAlbedo / M_PI / paths));
        CHECK(value.y == Approx(4 * double(value.x)));
        CHECK(ratio == Approx((k == 0 ? 1e-3 : kDvc) * cosine / M_PI / paths));
    }
    int shorter = 0;
    light.at(z, 5, [&](Rgb, float) { ++shorter; });
    CHECK(shorter == 2);  // the one behind four segments is too far away
    const auto count = [](const HitsOnlyLight<kAllFeatures>& of, const End& at) {
        int n = 0;
        of.at(at, 6, [&](Rgb, float) { ++n; });
        return n;
    };
    CHECK(count(light, end(0, -0.9f, 2, 0.5f)) == 1);  // seen from below
    // Of few subpaths close by, and at a place where there is nothing but they.
    for (End& e : ends) e.vertex.point.p = e.vertex.point.p * 0.01f;
    CHECK(count(HitsOnlyLight<kAllFeatures>(PilotMis(mis), all, 1), z) == 3);
    for (End& e : ends) e.vertex.point.p = {0, 0, 0};
    CHECK(count(HitsOnlyLight<kAllFeatures>(PilotMis(mis), all, kSubpaths), z) == 0);
    for (size_t k = 0; k < ends.size(); ++k) {
        ends[k].vertex.point.p = {0.1f * float(k + 1), 0, 0};
        for (MisSums& m : ends[k].vertex.sums.of) m = {0, kInfinity};
    }
    CHECK(count(HitsOnlyLight<kAllFeatures>(PilotMis(mis), all, kSubpaths), z) == 0);

    CHECK_FALSE(light.begins_at(1));
    CHECK(light.begins_at(2));
    CHECK_FALSE(light.holds(2, 3));
    CHECK(light.holds(2, 4));
    CHECK_FALSE(light.holds(1, 4));
}

namespace {

/// A crop of 8 x 6 pixels that begins at (3,10).
Scene cropped(FilterType filter, float radius) {
    Scene scene;
    Sensor& s = scene.sensor;
    s.crop_x = 3;
    s.crop_y = 10;
    s.crop_width = 8;
    s.crop_height = 6;
    s.filter = filter;
    s.filter_radius = radius;
    return scene;
}

}  // namespace

TEST_CASE("places of a crop are in its blocks, and those beside it in the blocks along its edges") {
    const Scene scene = cropped(FilterType::box, 0.5f);
    const FilmBlocks blocks = {4, 3};
    CHECK(blocks.count() == 12);
    for (uint32_t y = 0; y < 6; ++y)
        for (uint32_t x = 0; x < 8; ++x) {
            CAPTURE(x, y);
            CHECK(blocks.at(scene.sensor, {3.5f + float(x), 10.5f + float(y)}) == y / 2 * 4 + x / 2);
        }
    CHECK(blocks.at(scene.sensor, {2.75f, 9.75f}) == 0);
    CHECK(blocks.at(scene.sensor, {11.25f, 12.0f}) == 4 + 3);
    CHECK(blocks.at(scene.sensor, {5.0f, 99.0f}) == 8 + 1);
    // Seven pixels in three blocks: 2, 2 and 3.
    for (const auto& [block, first] : {std::pair{0u, 0u}, {1u, 2u}, {2u, 4u}, {3u, 7u}})
        CHECK(FilmBlocks::edge(block, 7, 3) == first);
}

TEST_CASE("what a splat counts for is the sum of the filters of the film's pixels where it lands") {
    const auto coverage = [](const Scene& scene, float x, float y) {
        return filter_coverage(scene.view(), {3 + x, 10 + y});
    };
    const Scene box = cropped(FilterType::box, 0.5f), tent = cropped(FilterType::tent, 1.0f);
    for (const auto& [x, y] : {std::pair{0.25f, 0.25f}, {4.0f, 3.0f}, {7.75f, 5.75f}}) CHECK(coverage(box, x, y) == 1);
    for (const auto& [x, y] : {std::pair{-0.25f, 3.0f}, {8.25f, 3.0f}, {4.0f, -0.25f}, {4.0f, 6.25f}})
        CHECK(coverage(box, x, y) == 0);
    CHECK(coverage(tent, 4, 3) == 1);
    // A quarter of a pixel from an edge the pixel beside the film has a quarter of the light.
    for (const auto& [x, y] : {std::pair{0.25f, 3.0f}, {7.75f, 3.0f}, {4.0f, 0.25f}, {4.0f, 5.75f}})
        CHECK(coverage(tent, x, y) == Approx(0.75));
    for (const auto& [x, y] : {std::pair{-0.25f, 3.0f}, {8.25f, 3.0f}, {4.0f, -0.25f}, {4.0f, 6.25f}})
        CHECK(coverage(tent, x, y) == Approx(0.25));
    CHECK(coverage(tent, 0.25f, 5.75f) == Approx(0.75 * 0.75));
    CHECK(coverage(tent, 8.25f, 0.25f) == Approx(0.25 * 0.75));
    CHECK(coverage(tent, -0.6f, 3) == 0);
    // Just inside.
    CHECK(coverage(box, 0.003f, 3) == 1);
    CHECK(coverage(box, 4, 0.003f) == 1);
    // A narrow filter counts no splat more than once.
    const Scene narrow = cropped(FilterType::tent, 0.5f);
    CHECK(coverage(narrow, 0.4f, 0.4f) == 1);
    CHECK(filter_energy(narrow.view()) == 1);

    CHECK(filter_energy(box.view()) == Approx(1));
    CHECK(filter_energy(tent.view()) == Approx(2.0 / 3 * 2 / 3).epsilon(1e-3));
    CHECK(filter_energy(cropped(FilterType::box, 1.0f).view()) == Approx(0.25));
}

namespace {

/// A path tracer, paired subpaths, half a light subpath without connections, and three draws from a cache.
SecondMoments four_candidates() {
    SecondMoments m;
    m.candidates = {{0, false, 0}, {1, true, 0}, {0.5f, false, 0}, {1, true, 3}};
    m.samples = 1000;
    m.light_vertices = 2000;
    m.filter_energy = 0.25f;
    return m;
}

double sqr_of(double x) { return x * x; }

}  // namespace

TEST_CASE("a path counts for the second moment of a candidate as often as that would find it") {
    SecondMoments m = four_candidates();
    const PilotShares shares = {2, 3, 4};
    const double sums[] = {2, 2 + 3 + 4, 2 + 0.5 * 3, 2 + 3 + 4 * 3 * 1000.0 / 2000};
    for (uint32_t c = 0; c < 4; ++c) CHECK(m.sum_of(c, shares) == Approx(sums[c]));
    CHECK(m.connections(m.candidates[3]) == Approx(1.5));
    CHECK(m.connections(m.candidates[1]) == 1);
    PilotEvent e = {{1, 2, 3}, shares, 0.5f};
    CHECK(e.total() == 9);
    PilotSums found;
    for (int times = 0; times < 2; ++times) m.add(e, found);
    const double light[] = {0, 3, 1.5, 3};
    for (uint32_t c = 0; c < 4; ++c) {
        CAPTURE(c);
        // Of light tracing a splat is spread by the filter.
        const double moment = 0.5 * (1 - 0.75 * light[c] / sums[c]) / (9 * sums[c]);
        CHECK(m.second_moment(c, e, float(sums[c])) == Approx(moment));
        for (int k = 0; k < 3; ++k) CHECK(found.variance[c][k] == Approx(2 * moment * sqr_of(k + 1)));
    }
    for (int k = 0; k < 3; ++k) CHECK(found.mean[k] == Approx(2 * 0.5 * (k + 1) / 9));
    CHECK(found.rare.empty());

    e.nearby = true;
    CHECK(e.total() == 1);
    m.light_vertices = 0;
    CHECK(m.connections(m.candidates[3]) == 3000);

    // Rare is what some candidate finds, but fifty times less often.
    const auto rare = [&](PilotShares of) {
        PilotSums s;
        m.add({{1, 1, 1}, of}, s);
        return s.rare.size();
    };
    CHECK(rare({0, 1, 0}) == 0);  // never
    CHECK(rare({0.019f, 0.981f, 0}) == 1);
    CHECK(rare({0.021f, 0.979f, 0}) == 0);
}

TEST_CASE("variances are relative to means of blocks and their neighbours, or to emitters seen") {
    const SecondMoments m = four_candidates();
    constexpr uint32_t kWidth = 4, kHeight = 3, kPerBlock = 2, kSamples = 4;
    constexpr double kAll = kPerBlock * kSamples;
    std::vector<PilotSums> pixels(kWidth * kHeight * kPerBlock);
    pixels[0].mean[0] = pixels[1].mean[0] = 12 * kAll / 2;  // of the first block: 12
    for (size_t p = 0; p < pixels.size(); p += kPerBlock) pixels[p].variance[1][0] = 30;
    pixels[10 * kPerBlock].seen[0] = 2;
    const PilotSplat splat = {{{8, 0, 0}, {1, 2, 1}, 0.5f}, 11, true, {3, 0, 0}},
                     seldom = {{{0, 0, 0.25f}, {0.005f, 0.05f, 0}}, 7, false, {0, 0, 3}};
    Pilot result;
    result.blocks_x = kWidth;
    result.blocks_y = kHeight;
    predict_variances(m, {pixels, {&splat, &seldom}, kPerBlock, kSamples, 100, 1000}, result);
    REQUIRE(result.variance.size() == 4);
    REQUIRE(result.variance[0].size() == kWidth * kHeight);
    // The splat brings 8 * 0.5 / 4 / kAll to the mean of the last block, of which four and six blocks are neighbours.
    const double from_splat = 1 / kAll;
    const double scale[kHeight][kWidth] = {{12.0 / 4, 12.0 / 6, 0, 0},
                                           {12.0 / 6, 12.0 / 9, from_splat / 9, from_splat / 6},
                                           {0, 0, from_splat / 6, from_splat / 4}};
    for (uint32_t y = 0; y < kHeight; ++y)
        for (uint32_t x = 0; x < kWidth; ++x) {
            CAPTURE(x, y);
            const uint32_t b = y * kWidth + x;
            const double seen = b == 10 ? 2 : scale[y][x];
            double expected = 30 / (3 * kAll * (sqr_of(seen) + 0.01));
            if (b == 11) {
                const double moment = 0.5 * (1 - 0.75 * 2 / 4) / (4 * 4);
                expected += moment * 64 / (3 * kAll * (9 + 0.01));
            }
            if (b != 7) CHECK(result.variance[1][b] == Approx(expected));
        }
    // Of the path tracer, whose strategies found a quarter of the splat's light.
    CHECK(result.variance[0][11] == Approx(0.5 / 4 * 64 / (3 * kAll * 9.01)));
    CHECK(result.variance[0][0] == 0);
    // Seldom, yet not rare. Four blocks around are lit by it alone.
    const double light = 0.25 / 0.055 / kAll / 6;
    CHECK(result.variance[0][7] == Approx(sqr_of(0.25) / (0.055 * 0.005) / (3 * kAll * (sqr_of(light) + 0.01))));
}

TEST_CASE("of the brightest contributions, of which a render has one, the light is missing instead") {
    constexpr uint32_t kWidth = 2, kHeight = 3, kBlocks = kWidth * kHeight, kSamples = 4;
    constexpr double kExpected = 50;
    SecondMoments m = four_candidates();
    m.candidates = {{0, false, 0}, {0.01f, false, 0}};
    m.samples = 1'000'000;
    // Hits find them seldom, and the last one never, which few light subpaths find seldom.
    struct Found {
        uint32_t block;
        Rgb value;
        float hits, light, coverage;
    };
    std::vector<Found> all = {
        {0, {60, 1, 0}, 0.1f, 9.9f, 1},  {1, {0, 40, 2}, 0.02f, 9.98f, 1},   {2, {3, 0, 10}, 0.15f, 9.85f, 0.5f},
        {3, {1, 2, 0}, 0.05f, 9.95f, 1}, {3, {2, 5, 1}, 0.06f, 9.94f, 1},    {3, {9, 0, 0}, 0.07f, 9.93f, 0.25f},
        {4, {7, 7, 7}, 0.01f, 1.99f, 1}, {5, {0, 0, 30}, 0.019f, 0.981f, 1}, {0, {0, 0, 5}, 0, 10, 1}};
    for (uint32_t i = 0; i < 40; ++i) {
        const Vec4f u = random_floats({9, i, 0, Stream::test}, 0), v = random_floats({9, i, 0, Stream::test}, 1);
        all.push_back({i % kBlocks, {10 * u.x, 5 * u.y, 2 * u.z}, 0.01f + 0.18f * u.w, 9.9f, 0.25f + 0.75f * v.x});
    }
    std::vector<PilotSums> pixels(kBlocks);
    pixels[0].seen[0] = 100;
    for (double& seen : pixels[3].seen) seen = 1e4;  // all is small beside it
    double scale[kBlocks][3] = {}, scale2[kBlocks][3];
    const auto blur = [&](uint32_t from, double to[kBlocks][3], int k, double value) {
        for (uint32_t b = 0; b < kBlocks; ++b) {
            const uint32_t y = b / kWidth, rows = y == 1 ? 3 : 2;
            if (std::abs(int(from / kWidth) - int(y)) <= 1) to[b][k] += value / (rows * kWidth);
        }
    };
    for (const Found& f : all) {
        m.add({f.value, {f.hits, f.light, 0}, f.coverage}, pixels[f.block]);
        for (int k = 0; k < 3; ++k)
            blur(f.block, scale, k, double(f.coverage * f.value[k]) / double(f.hits + f.light) / kSamples);
    }
    for (uint32_t b = 0; b < kBlocks; ++b)
        for (int k = 0; k < 3; ++k) scale2[b][k] = sqr_of(std::max(scale[b][k], pixels[b].seen[k])) + 0.01;
    std::vector<std::pair<double, const Found*>> by_size;
    for (const Found& f : all) {
        if (f.hits == 0) continue;
        double size = 0;
        for (int k = 0; k < 3; ++k)
            size = std::max(size, double(f.value[k]) / double(f.hits) / std::sqrt(scale2[f.block][k]));
        by_size.emplace_back(-size, &f);
    }
    std::sort(by_size.begin(), by_size.end());
    double probability = 0;
    for (size_t taken = 0; taken <= by_size.size(); ++taken) {
        CAPTURE(taken);
        const auto share = [&](size_t i) {
            const Found& f = *by_size[i].second;
            return double(f.coverage) * double(f.hits) / double(f.hits + f.light) / m.samples;
        };
        if (taken > 0) probability += share(taken - 1);
        // Less than the next one needs.
        const double more = taken < by_size.size() ? share(taken) : 1e-5, outliers = probability + 0.5 * more;
        double expected[kBlocks] = {}, lost[kBlocks][3] = {};
        for (size_t i = 0; i < by_size.size(); ++i) {
            const Found& f = *by_size[i].second;
            for (int k = 0; k < 3; ++k) {
                const double value = double(f.value[k]), total = double(f.hits + f.light);
                if (i < taken)
                    blur(f.block, lost, k, double(f.coverage) * value / total / kSamples);
                else
                    expected[f.block] += double(f.coverage) * value * value / total / double(f.hits) /
                                         (3 * kSamples * scale2[f.block][k]);
            }
        }
        Pilot result;
        result.blocks_x = kWidth;
        result.blocks_y = kHeight;
        predict_variances(m, {pixels, {}, 1, kSamples, kExpected, uint64_t(1 / (outliers * kExpected))}, result);
        for (uint32_t b = 0; b < kBlocks; ++b) {
            CAPTURE(b);
            for (int k = 0; k < 3; ++k)
                expected[b] += kExpected * sqr_of(lost[b][k]) / (3 * (sqr_of(scale[b][k]) + 0.01));
            CHECK(result.variance[0][b] == Approx(expected[b]).epsilon(1e-4).margin(1e-6));
        }
    }
}
