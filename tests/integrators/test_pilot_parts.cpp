// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// What the pilot of bdpt.auto=true is made of: weights of three sets of strategies, light from vertices nearby, and
// what splats count for.
#include <map>
#include <tuple>

#include "accel/embree_tracer.h"
#include "integrators/auto/film_footprint.h"
#include "integrators/auto/merging.h"
#include "integrators/auto/pilot_mis.h"
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
    const Scene scene =
        scene_from_text(scene_xml(6, "<sensor type='perspective'>" + film(4) + "</sensor><shape type='rectangle'>" +
                                         diffuse({kAlbedo, kAlbedo, kAlbedo}) + "</shape>"));
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
                             end(0.01f, 1, 1, 512),   end(0.02f, 1, 2, 1024)};
    ends[3].vertex.point.ng = {0.8f, 0, 0.6f};  // around an edge
    ends[4].vertex.point.ng = {0.6f, 0, 0.8f};
    ends[7].vertex.sums.of[2].dvcm = 0.9e-4f * kDvc;        // connections find it too, as cosines are
    for (MisSums& m : ends[10].vertex.sums.of) m = {0, 0};  // hits do not find it
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
        CHECK(ratio == Approx(kDvc * cosine / M_PI / paths));
    }
    int shorter = 0;
    light.at(z, 5, [&](Rgb, float) { ++shorter; });
    CHECK(shorter == 2);  // the one behind four segments is too far away

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

    CHECK(filter_energy(box.view()) == Approx(1));
    CHECK(filter_energy(tent.view()) == Approx(2.0 / 3 * 2 / 3).epsilon(1e-3));
    CHECK(filter_energy(cropped(FilterType::box, 1.0f).view()) == Approx(0.25));
}
