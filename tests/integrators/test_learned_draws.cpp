// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// long: tagged
// Variant learned of bdpt: draws from a cache that follow what earlier samples have found.
#include <cmath>
#include <numeric>

#include "accel/host_tracer.h"
#include "backends/fusion.h"
#include "core/rng.h"
#include "integrators/bdpt/learned/cells.h"
#include "integrators/bdpt/learned/cluster_light_vertices.h"
#include "integrators/bdpt/learned/draws.h"
#include "integrators/bdpt/learned/integrator.h"
#include "integrators/bdpt/learned/update_draws.h"
#include "integrators/bdpt/lvc/integrator.h"
#include "render/wave_plan.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

RenderSettings settings_of(const Scene& scene, const char* variant, uint64_t seed) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.integrator = "bdpt";
    s.variant = variant;
    return s;
}

/// Of one sample, relative to the squared mean: what relMSE is made of.
double relative_variance(const FilmMoments& film) {
    double sum = 0;
    const double n = double(film.samples);
    for (size_t i = 0; i < film.sum.size(); ++i) {
        const double mean = film.sum[i] / n, variance = (film.sum_squares[i] / n - mean * mean) * n / (n - 1);
        sum += variance / (mean * mean + 0.01);
    }
    return sum / double(film.sum.size());
}

}  // namespace

TEST_CASE("learned draws have the expectation of paired subpaths, whatever their share and their weight") {
    for (const char* name : first_or_all<const char*>(2, {"cornell", "glass", "lights", "materials"})) {
        const Scene scene = project_scene(name, 40, 30);
        // Hits of the lamp by way of the sphere are rare and the same for both variants.
        const char* strategies = name == std::string("glass") ? "next_event+connections+light" : "all";
        RenderSettings reference = settings_of(scene, "wavefront", 21);
        apply_setting(reference, "strategies", strategies);
        const Estimate paired = render_batches(scene, reference, 512);
        RenderSettings s = settings_of(scene, "learned", 22);
        apply_setting(s, "strategies", strategies);
        INFO(name);
        check_agreement(scene, s, 256, paired, 0.08);
        if (name != std::string("cornell")) continue;
        for (const auto& [draws, share, weight] : {std::tuple{1u, "0.95", "4"}, {8u, "0.3", "0.5"}}) {
            s.connections = draws;
            apply_setting(s, "learned_share", share);
            apply_setting(s, "learned_weight", weight);
            INFO(draws << " draws, share " << share << ", weight " << weight);
            check_agreement(scene, s, 256, paired, 0.08);
        }
    }
}

TEST_CASE("learned draws of connections alone, for both heuristics and over stages with queues of their own") {
    const Scene scene = project_scene("cornell", 32, 32);
    RenderSettings s = settings_of(scene, "wavefront", 31);
    apply_setting(s, "strategies", "connections+light");
    s.max_depth = 4;
    for (const MisHeuristic heuristic : {MisHeuristic::balance, MisHeuristic::power}) {
        s.heuristic = heuristic;
        s.variant = "wavefront";
        const Estimate paired = render_batches(scene, s, 256);
        RenderSettings learned = s;
        learned.variant = "learned";
        learned.seed = 32;
        check_agreement(scene, learned, 256, paired, 0.06);
        check_stages_of_their_own(scene, learned, 5);
    }
}

TEST_CASE("what is learned does not depend on the order of threads, and memory is what was predicted") {
    const Scene scene = project_scene("materials", 64, 48);
    const RenderSettings s = settings_of(scene, "learned", 5);
    const RenderResult a = render_scene(scene, s, 9), b = render_scene(scene, s, 9);
    CHECK(a.film.sum == b.film.sum);
    CHECK(a.film.sum_squares == b.film.sum_squares);
    CHECK(a.stats.memory_bytes == a.stats.memory_bytes_predicted);
    CHECK(a.stats.invalid.total() == 0);
    for (const QueueStats& q : a.stats.queues) CHECK(q.overflow == 0);
}

TEST_CASE("scenes without light vertices, and paths too short for connections") {
    for (const int depth : {0, 1, 2, 3}) {
        const Scene scene = project_scene("cornell", 16, 16);
        RenderSettings s = settings_of(scene, "learned", 5);
        s.max_depth = depth;
        CHECK(render_scene(scene, s, 4).stats.invalid.total() == 0);
    }
}

TEST_CASE("a draw finds a vertex with the probability that its contribution is divided by") {
    constexpr uint32_t kLevels = 3, kClusters = 1u << kLevels, kVertices = 57, kDraws = 3, kKeys = 200'000;
    std::vector<DrawSplit> splits(kClusters);
    std::vector<uint16_t> tickets = {100, 100, 20000, 20001, 40000, 50000, 50000, 60000}, cluster(kVertices),
                          keys(kVertices);
    std::vector<uint32_t> sorted(kVertices), first(kClusters + 1);
    for (uint32_t i = 0; i < kVertices; ++i) cluster[i] = uint16_t(i * 5 % 7 == 6 ? 4 : i * 5 % 7);  // 6, 7 are empty
    for (const uint16_t c : cluster) ++first[c + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<uint32_t> next = first;
    for (uint32_t i = 0; i < kVertices; ++i) sorted[next[cluster[i]]++] = i;
    for (uint32_t i = 0; i < kVertices; ++i) keys[i] = ClusteredVertices::key(cluster[i], i);
    QueueCounter counter = {};
    counter.count = counter.capacity = kVertices;
    LearnedSource source = {};
    source.vertices.counter = &counter;
    source.draws = kDraws;
    source.by_cluster.first = first.data();
    source.by_cluster.sort.keys[0] = keys.data();
    source.by_cluster.sort.values[1] = sorted.data();
    source.table = {{splits.data(), 0}, {splits.data(), kLevels}, tickets.data(), nullptr, 1.0f};
    std::vector<uint64_t> counts(kVertices);
    uint64_t none = 0;
    const BidirectionalVertex z = {};
    for (uint32_t k = 0; k < kKeys; ++k) {
        const RngKey key = {1, k, 0, Stream::test};
        const LearnedSearch search = {source, key, 1, z, 10, 0};
        for (uint32_t d = 0; d < kDraws; ++d) {
            const uint32_t at = search.drawn(d, kVertices);
            ++(at == kNone ? none : counts[at]);
        }
    }
    double probability = 0;
    for (uint32_t i = 0; i < kVertices; ++i) {
        const double p = 1.0 / double(LearnedDraw{source, 0, cluster[i], i}.inverse_probability());
        const double expected = p * kKeys * kDraws;
        INFO("vertex " << i << ": " << counts[i] << ", expected " << expected);
        CHECK(std::fabs(double(counts[i]) - expected) < 5 * std::sqrt(expected));
        probability += p;
    }
    const double missing = (1.0 - probability) * kKeys * kDraws;
    CHECK(std::fabs(double(none) - missing) < 5 * std::sqrt(missing));
}

TEST_CASE("an eye vertex has the cell of the side of its surface that it is seen from, however flat") {
    DrawSplit splits[2] = {{}, {0.0f, 5}};  // whether the normal points upwards
    LearnedSource source = {};
    source.table.cells = {splits, 1};
    for (const float cosine : {-1.0f, -0.5f, -0.005f, -1e-6f, 1e-6f, 0.005f, 0.5f, 1.0f})
        for (const float ng : {-1.0f, 1.0f}) {
            CAPTURE(cosine, ng);
            BidirectionalVertex v = {};
            v.scattering.ng = {0, 0, ng};
            v.scattering.wi_world = {sqrtf(1 - cosine * cosine), 0, cosine};
            CHECK(source.link(v, 0) == (cosine > 0 ? 1 : 0));
        }
}

namespace {

template <class Integrator>
struct Piloted {
    typename Integrator::Policy policy;
    double mean;  ///< light vertices of a subpath
};

template <class Integrator>
Piloted<Integrator> piloted(const Scene& scene, const RenderSettings& s, uint64_t seed = 7) {
    Piloted<Integrator> p = {Integrator::plan(scene, s), 0};
    const EmbreeAccel accel(scene);
    p.mean = Integrator::pilot(p.policy, scene.view(), HostTracer(accel.tracer()), seed);
    return p;
}

/// A point light and a camera in the middle of a sphere. No subpath leaves it.
Scene hollow_sphere(const std::string& bsdf, float intensity = 1) {
    return scene_from_text(
        scene_xml(3, "<sensor type='perspective'><float name='near_clip' value='1e-4'/>" + square_film(16) +
                         "</sensor><shape type='sphere'><boolean name='flip_normals' value='true'/>" + bsdf +
                         "</shape><emitter type='point'><point name='position' x='0' y='0' z='0'/>" +
                         rgb("intensity", {intensity, intensity, intensity}) + "</emitter>"));
}

}  // namespace

TEST_CASE("weights count draws as often as they meet a subpath's vertex on average, times what is set") {
    using Learned = LearnedIntegrator<kAllFeatures, EmbreeTracer, kNoFusion>;
    using Lvc = LvcIntegrator<kAllFeatures, EmbreeTracer, kNoFusion>;
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings lvc = settings_of(scene, "lvc", 1), learned = settings_of(scene, "learned", 1);
    for (const uint32_t draws : {1u, 6u}) {
        CAPTURE(draws);
        lvc.connections = learned.connections = draws;
        const Piloted<Lvc> a = piloted<Lvc>(scene, lvc);
        CHECK(a.mean > 1);
        CHECK(a.policy.rules.mis.connections == Approx(draws / a.mean));
        for (const float weight : {1.0f, 8.0f}) {
            apply_setting(learned, "learned_weight", std::to_string(weight));
            const Piloted<Learned> b = piloted<Learned>(scene, learned);
            CHECK(b.mean == Approx(a.mean).epsilon(0.2));
            CHECK(b.policy.rules.mis.connections == Approx(double(weight) * draws / b.mean));
        }
    }
    lvc.strategies = learned.strategies = kHitStrategies;
    CHECK(piloted<Lvc>(scene, lvc).mean == 0);
    CHECK(piloted<Lvc>(scene, lvc).policy.rules.mis.connections == 1);
    CHECK(piloted<Learned>(scene, learned).mean == 0);
    CHECK(piloted<Learned>(scene, learned).policy.rules.mis.connections == 1);
}

TEST_CASE("light vertices are counted up to two segments before the longest path: those that connections may use") {
    using Learned = LearnedIntegrator<kAllFeatures, EmbreeTracer, kNoFusion>;
    using Lvc = LvcIntegrator<kAllFeatures, EmbreeTracer, kNoFusion>;
    const Scene scene = hollow_sphere(diffuse({0.5f, 0.5f, 0.5f}));
    RenderSettings lvc = settings_of(scene, "lvc", 1), learned = settings_of(scene, "learned", 1);
    lvc.rr_depth = learned.rr_depth = -1;
    for (const int depth : {1, 2, 3, 6}) {
        CAPTURE(depth);
        lvc.max_depth = learned.max_depth = depth;
        const int vertices = std::max(0, depth - 2);
        CHECK(piloted<Lvc>(scene, lvc).mean == vertices);
        CHECK(piloted<Learned>(scene, learned).mean == vertices);
    }
}

TEST_CASE("scores are counted in the square of what connections bring on average, unless that is next to nothing") {
    using Learned = LearnedIntegrator<kAllFeatures, EmbreeTracer, kNoFusion>;
    // Half of what light subpaths meet, and half of what the camera sees, reflects 0.9, the rest 0.1.
    const std::string halves =
        "<bsdf type='diffuse'><texture type='checkerboard' name='reflectance'><rgb name='color0' value='0.9,0.9,0.9'/>"
        "<rgb name='color1' value='0.1,0.1,0.1'/></texture></bsdf>";
    const auto unit_of = [&](float intensity, uint64_t seed) {
        const Scene scene = hollow_sphere(halves, intensity);
        RenderSettings s = settings_of(scene, "learned", 1);
        apply_setting(s, "strategies", "connections");
        return double(piloted<Learned>(scene, s, seed).policy.found.unit);
    };
    // Between two points of a sphere of radius 1 the geometry term is 1/4; the lamp's flux is 4 pi.
    const double mean = 0.5 / M_PI * 0.5 / M_PI / 4 * 4 * M_PI;
    for (uint64_t seed = 1; seed <= 3; ++seed) {
        CAPTURE(seed);
        CHECK(unit_of(1, seed) == Approx(mean * mean).epsilon(0.4));
        CHECK(unit_of(2, seed) == 4 * unit_of(1, seed));
        CHECK(unit_of(1e-6f, seed) < 1e-12);
    }
    CHECK(unit_of(0, 1) == 1);
}

TEST_CASE("of a wave of many light subpaths every n-th vertex teaches, for n") {
    // One cluster of eight vertices and no tickets: every vertex has the probability 1/8 in a draw.
    constexpr uint32_t kVertices = 8, kDraws = 2;
    std::vector<DrawSplit> splits(1);
    std::vector<uint16_t> tickets(1);
    std::vector<uint32_t> first = {0, kVertices};
    QueueCounter counter = {};
    counter.count = counter.capacity = kVertices;
    LearnedSource source = {};
    source.vertices.counter = &counter;
    source.draws = kDraws;
    source.by_cluster.first = first.data();
    source.table = {{splits.data(), 0}, {splits.data(), 0}, tickets.data(), nullptr, 1e15f};
    for (const uint32_t teaching_for : {1u, 3u}) {
        WaveState state = {};
        state.light_subpaths = ((teaching_for - 1) << 20) + 1000;
        const double n = kVertices, paths = state.light_subpaths;
        for (uint32_t place = 0; place < kVertices; ++place) {
            Candidate<BidirectionalMis> c = {};
            c.value = {1, 1, 1};
            const Score score = LearnedDraw{source, 0, 0, place}.note(c, {1, 1, 1}, state);
            INFO("vertex " << place << ", one of " << teaching_for);
            const bool teaches = place % teaching_for == 0;
            CHECK((score.entry == 0) == teaches);
            CHECK((score.entry == kNone) == !teaches);
            // n_l y² / (N² κ P_e(v)) of docs/theory.md, section 7, with y = 1 and P_e(v) = 1/n.
            if (teaches) CHECK(double(score.value) == Approx(teaching_for * 1e15 * n * n / (paths * paths * kDraws)));
        }
    }
}

TEST_CASE("waves that learn are as large as all before them together, until they are whole") {
    for (const auto& [done, samples] : {std::pair{0u, 1u}, {1u, 1u}, {2u, 2u}, {32u, 32u}, {63u, 63u}, {64u, 500u}})
        CHECK(learning_pass(500, done, 64) == samples);
    CHECK(learning_pass(3, 32, 64) == 3);
}

TEST_CASE("leaves of a tree of cells hold as many points each, and some where many points share a coordinate") {
    for (const bool sides : {false, true}) {
        std::vector<PilotPoint> points(4096);
        for (uint32_t i = 0; i < points.size(); ++i) {
            const Vec4f u = random_floats({3, i, 0, Stream::test}, 0);
            points[i] = {{u.x * 10, u.y * u.y, u.z, 0, 0, !sides ? u.w : u.w < 0.25f ? 1.0f : -1.0f}};
        }
        std::vector<DrawSplit> splits = split_points(points, 6);
        const DrawTree tree = {splits.data(), 6};
        std::vector<uint32_t> counts(64);
        for (const PilotPoint& p : points) ++counts[tree.leaf({p.x[0], p.x[1], p.x[2]}, {p.x[3], p.x[4], p.x[5]})];
        for (const uint32_t n : counts) {
            if (sides)
                CHECK(n > 0);
            else
                CHECK(n == 64);
        }
    }
    const std::vector<PilotPoint> points(3);
    for (const uint32_t few : {0u, 1u, 3u}) CHECK(split_points({points.begin(), points.begin() + few}, 4).size() == 16);
}

TEST_CASE("splits of a tree of cells look at one coordinate of the place or of the normal") {
    const Vec3f p = {1, 2, 3}, n = {4, 5, 6};
    for (uint32_t axis = 0; axis < 6; ++axis) {
        const float value = float(axis + 1);
        for (const float at : {value - 0.5f, value, value + 0.5f}) {
            DrawSplit splits[2] = {{}, {at, axis}};
            CHECK(DrawTree{splits, 1}.leaf(p, n) == (value >= at ? 1 : 0));
        }
    }
}

TEST_CASE("clusters begin where the vertices of those before end") {
    // Keys of parts 3 and 15 of cluster 0, 0 and 1 of cluster 2.
    std::vector<uint16_t> keys;
    for (const auto& [cluster, vertex] : {std::pair{0u, 3 * 32u}, {0u, 15 * 32u}, {2u, 0u}, {2u, 32u}})
        keys.push_back(ClusteredVertices::key(cluster, vertex));
    CHECK(std::is_sorted(keys.begin(), keys.end()));
    QueueCounter counter{};
    counter.capacity = counter.count = 4;
    std::vector<uint32_t> first(4);
    LearnedSource source{};
    source.vertices.counter = &counter;
    source.by_cluster.first = first.data();
    source.by_cluster.sort.keys[1] = keys.data();
    const FindClusters find = {source, nullptr};
    for (uint32_t cluster = 0; cluster < 4; ++cluster) find(cluster);
    CHECK(first == std::vector<uint32_t>{0, 2, 2, 4});
}

namespace {

/// Two clusters, and the first group of cells; in cell c they have brought sums[2c] and sums[2c + 1].
struct LearnedGroup {
    std::vector<int64_t> sums = std::vector<int64_t>(16);
    std::vector<uint16_t> tickets = std::vector<uint16_t>(16, 7);
    WaveState state = {};

    /// After wave samples [first, first + count).
    void update(float share, uint32_t first = 0, uint32_t count = 1) {
        state.first_sample = first;
        state.samples = count;
        UpdateDraws{{{nullptr, 3}, {nullptr, 1}, tickets.data(), sums.data(), 1.0f}, &state, share, nullptr}(0);
    }
    bool updates(uint32_t first, uint32_t count) {
        tickets.assign(16, 7);
        update(1.0f, first, count);
        return tickets != std::vector<uint16_t>(16, 7);
    }
};

}  // namespace

TEST_CASE(
    "a cell draws by the roots of what its clusters brought: six tenths are its own, the rest of its neighbours") {
    LearnedGroup g;
    g.update(1.0f);
    CHECK(g.tickets == std::vector<uint16_t>(16, 7));  // nothing was learned
    g.sums = {300, 100, 0, 500, 40, 0, 10, 50};
    g.sums.resize(16);
    const double of_group[2] = {350.0 / 1000, 650.0 / 1000};
    for (const double share : {1.0, 0.75, 0.01}) {
        g.update(float(share));
        for (uint32_t c = 0; c < 8; ++c) {
            CAPTURE(share, c);
            double roots[2];
            for (uint32_t k = 0; k < 2; ++k) {
                const double all = double(g.sums[2 * c] + g.sums[2 * c + 1]);
                roots[k] = std::sqrt(0.4 * of_group[k] + (all > 0 ? 0.6 * double(g.sums[2 * c + k]) / all : 0));
            }
            CHECK(g.tickets[2 * c] == Approx(share * 65535 * roots[0] / (roots[0] + roots[1])).margin(1));
            CHECK(g.tickets[2 * c + 1] == Approx(share * 65535).margin(1));
        }
    }
    // All of the tickets but one are to be had.
    g.sums.assign(16, 0);
    g.sums[1] = 1024;
    g.update(1.0f);
    CHECK(g.tickets[14] == 0);
    CHECK(g.tickets[15] == 65535);
}

TEST_CASE("what was learned is used after 1, 2, 4, 8 and 16 samples, and then after every 16") {
    LearnedGroup g;
    g.sums[0] = 1;
    std::vector<uint32_t> after;
    for (uint32_t sample = 0; sample < 70; ++sample)
        if (g.updates(sample, 1)) after.push_back(sample + 1);
    CHECK(after == std::vector<uint32_t>{1, 2, 4, 8, 16, 32, 48, 64});
    CHECK(g.updates(40, 8));
    CHECK(g.updates(41, 15));
    CHECK_FALSE(g.updates(33, 14));
    CHECK(g.updates(33, 16));
    CHECK(g.updates(32, 500));
}

TEST_CASE("behind a door ajar learned draws have much less variance than uniform ones", "[data][long]") {
    const auto scene = published_scene("veach-ajar", 64, 36);
    if (!scene) return;
    const double uniform = relative_variance(render_scene(*scene, settings_of(*scene, "lvc", 3), 128).film),
                 learned = relative_variance(render_scene(*scene, settings_of(*scene, "learned", 3), 128).film);
    INFO(uniform << " and " << learned);
    CHECK(learned < uniform * 0.65);
}
