// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Stages of light tracing and bidirectional path tracing over a wave whose queues a test may change: what is counted
// when values are no light or too large, and where splats land.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <utility>

#include "accel/cwbvh.h"
#include "backends/cpu/executor.h"
#include "integrators/bdpt/wavefront/integrator.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/closed_forms.h"
#include "tests/support/render_checks.h"
#include "tests/support/third_sum.h"

using namespace ambilux;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

/// A wave over a whole film whose queues can be changed before a stage runs.
template <Fusion kFusion, class Mis = BidirectionalMis>
struct FusedBench {
    using Integrator = WavefrontOf<kAllFeatures, CwbvhTracer, kFusion, Mis>;
    using Stages = typename Integrator::Stages;

    Scene scene;
    CwbvhAccel accel;
    typename Integrator::Policy policy;
    Wave wave;
    WaveState state{};
    std::vector<Lane> bytes, samples;
    std::vector<double> splats;
    std::vector<double> sum, sum_squares;
    Layout layout;
    typename Integrator::Memory memory;
    std::string before;
    std::function<void(FusedBench&)> change;  ///< called once, before stage `before` runs for the first time
    bool changed = false;

    explicit FusedBench(Scene s, const Method& method = {"all"}, bool one_connection_per_launch = false)
        : scene(std::move(s)), accel(scene) {
        const RenderSettings settings = method_settings(scene, method, 5);
        policy = Integrator::plan(scene, settings);
        policy.one_connection_per_launch = one_connection_per_launch;
        const uint32_t film_tiles = tile_count(shape_wave(scene, settings.seed, kTilePixels, 1));
        wave = shape_wave(scene, settings.seed, film_tiles * kTilePixels, film_tiles);
        wave.samples = 1;
        const uint32_t slots = wave.slot_count();
        samples.resize(slots);
        splats.resize(size_t(wave.width) * wave.height * 3);
        sum.resize(splats.size());
        sum_squares.resize(splats.size());
        memory = Integrator::lay_out(layout, policy, {slots, slots * 64});
        stages(), update();
        const Layout plan = layout;
        bytes.resize(plan.bytes() / sizeof(Lane) + 64);
        void* start = bytes.data();
        size_t room = bytes.size() * sizeof(Lane);
        layout = Layout(plan, std::align(256, plan.bytes(), start, room));
        memory = Integrator::lay_out(layout, policy, {slots, slots * 64});
        stages(), update();
        REQUIRE(layout.bytes() == plan.bytes());
        const std::vector<QueueCounter> counters = layout.first_counters();
        std::copy(counters.begin(), counters.end(), layout.counters());
        state.samples = 1;
    }

    /// Runs stages like CpuExecutor, after the change.
    struct Executor : CpuExecutor {
        FusedBench& bench;
        explicit Executor(FusedBench& b) : CpuExecutor(&b.state), bench(b) {}
        /// `id`: of the stage's record.
        void prepare(const StageRecord* id, uint32_t items) {
            if (bench.changed || items == 0 || bench.before.empty() || id != &bench.record(bench.before)) return;
            bench.changed = true;
            bench.change(bench);
        }
        template <class Stage>
        void run_slots(const Stage& stage, uint32_t slots, uint32_t samples = 0) {
            prepare(stage.record, slots);
            CpuExecutor::run_slots(stage, slots, samples);
        }
        template <class Stage>
        void run(const Stage& stage) {
            prepare(stage.record, stage.items().counter->size());
            CpuExecutor::run(stage);
        }
        template <class Stage>
        void trace(const Stage& stage) {
            run(stage);
        }
        template <class Stage>
        void extend(const Stage& stage) {
            prepare(stage.record, stage.items().counter->size());
            CpuExecutor::extend(stage);
        }
        template <class Stage>
        void extend_coherent(const Stage& stage) {
            extend(stage);
        }
    };

    Wave this_wave() const {
        Wave w = wave;
        w.state = &state;
        return w;
    }
    SplatSums splat_sums() { return {splats.data(), nullptr}; }
    FilmSums sums() { return {sum.data(), sum_squares.data()}; }
    Stages stages() {
        const SceneView view = scene.view();
        const CwbvhTracer tracer = accel.tracer();
        const Wave in_flight = this_wave();
        const FilmBuffers film = {samples.data(), splat_sums(), sums()};
        return Stages(WaveParts<CwbvhTracer>{layout, view, tracer, in_flight, film}, policy, memory, NoState());
    }
    UpdateFilm update() {
        return {this_wave(), samples.data(), splat_sums(), sums(), layout.record(UpdateFilm::kName)};
    }
    StageRecord& record(const std::string& name) const {
        const std::vector<std::string>& names = layout.record_names();
        const auto at = std::find(names.begin(), names.end(), name);
        REQUIRE(at != names.end());
        return layout.records()[at - names.begin()];
    }

    void run(const std::string& stage = "", std::function<void(FusedBench&)> f = {}) {
        before = stage;
        change = std::move(f);
        Executor executor(*this);
        Integrator::schedule(executor, stages());
        const UpdateFilm film = update();
        executor.prepare(film.record, 1);
        for (uint32_t i = 0; i < wave.tiles * kTilePixels; ++i) film(i);
        REQUIRE((change == nullptr || changed));
        REQUIRE(state.failed == 0);
        for (double v : sum) {
            CHECK(std::isfinite(v));
            CHECK(v >= 0);
        }
    }
    /// Only stage `stage` counted anything, and what it counted is this; "": none did.
    void check_counts(const std::string& stage, uint64_t nan, uint64_t inf, uint64_t negative) const {
        if (!stage.empty()) record(stage);
        for (const std::string& name : layout.record_names()) {
            INFO("counts of " << name << ", injected into " << stage);
            CHECK(record(name).nan == (name == stage ? nan : 0));
            CHECK(record(name).inf == (name == stage ? inf : 0));
            CHECK(record(name).negative == (name == stage ? negative : 0));
        }
    }
    uint64_t count(const std::string& stage, int which) const {
        const StageRecord& r = record(stage);
        return which == 0 ? r.nan : which == 1 ? r.inf : r.negative;
    }
    double total() const {
        double t = 0;
        for (double v : sum) t += v;
        return t;
    }
};

/// Every stage by itself, with queues between them.
using Bench = FusedBench<Fusion{}>;
/// Candidates are weighted where they are found; shadow rays wait in a queue.
using WeighingBench = FusedBench<Fusion{.weigh = true, .connect = true}>;

template <class Item>
void edit(const Queue<Item>& queue, uint32_t i, const std::function<void(Item&)>& f) {
    REQUIRE(i < queue.counter->size());
    Item item = queue.load(i);
    f(item);
    queue.store(i, item);
}

Scene cornell() { return project_scene("cornell", 16, 16); }

/// A camera in front of a plane that is a lamp.
Scene lamp_seen() {
    return scene_from_text(scene_xml(1,
                                     "<sensor type='orthographic'><transform name='to_world'><lookat origin='0,0,1' "
                                     "target='0,0,0' up='0,1,0'/></transform>" +
                                         square_film(8) +
                                         "</sensor><shape type='rectangle'><transform "
                                         "name='to_world'><scale value='0.999'/></transform>" +
                                         area_light({1, 1, 1}) + "</shape>"));
}

constexpr std::pair<float, int> kBad[] = {{kNan, 0}, {kInf, 1}, {-1.0f, 2}};

}  // namespace

TEST_CASE("G9: nothing is counted in a clean wave, whose film is that of the renderer", "[bidirectional]") {
    for (const Method& m : kMethods) {
        INFO(m.name);
        Bench b(cornell(), m);
        b.run();
        b.check_counts("", 0, 0, 0);
        CHECK(b.total() > 0);
        RenderSettings s = method_settings(b.scene, m, 5);
        s.accel = "cwbvh";
        s.specialise = false;
        const FilmMoments film = render_scene(b.scene, s, 1).film;
        CHECK(film.sum == b.sum);
        CHECK(film.sum_squares == b.sum_squares);
    }
}

TEST_CASE("A third sum comes along to wherever weights ask for it, and the film is that of two sums") {
    const auto check = [&]<Fusion kFusion>(const Method& method) {
        FusedBench<kFusion> two(cornell(), method);
        FusedBench<kFusion, ThirdSumMis> three(cornell(), method);
        two.run();
        three.run();
        CHECK(two.total() > 0);
        CHECK(three.sum == two.sum);
        CHECK(three.sum_squares == two.sum_squares);
    };
    for (const Method& m : kMethods) {
        INFO(m.name);
        check.template operator()<Fusion{}>(m);
    }
    check.template operator()<Fusion{.weigh = true, .connect = true}>({"all"});
}

TEST_CASE("Launches with one pair of a path, and with as many as there is capacity for, connect the same pairs") {
    const Method connections = {"connections"};
    Bench several(cornell(), connections);
    several.run();
    const uint64_t pairs = several.record("connect_vertices").items, rays = several.record("occlude").items;
    CHECK(pairs > 256);
    const auto check_same = [&](auto& b) {
        b.run();
        CHECK(b.record("connect_vertices").items == pairs);
        CHECK(b.record("connect_vertices").launches > several.record("connect_vertices").launches);
        CHECK(b.record("occlude").items == rays);
        CHECK(b.sum == several.sum);
        for (size_t q = 0; q < b.layout.queue_names().size(); ++q) CHECK(b.layout.counters()[q].overflow == 0);
    };
    Bench one(cornell(), connections, true);
    check_same(one);
    const auto check_capacity = [&]<class AnyBench>(uint32_t capacity) {
        INFO("capacity " << capacity);
        AnyBench b(cornell(), connections);
        const auto limit = [capacity](auto& q) {
            if (q.capacity() > 0) q.items.capacity = q.counter->capacity = capacity;
        };
        limit(b.memory.eye.candidates), limit(b.memory.eye.shadows), limit(b.memory.eye.shadow_contributions);
        check_same(b);
    };
    for (const uint32_t capacity : {1u, 7u, 100u}) {
        check_capacity.template operator()<Bench>(capacity);
        check_capacity.template operator()<WeighingBench>(capacity);
    }
}

TEST_CASE("G9: light_generate counts emission that is none", "[bidirectional]") {
    for (auto [value, which] : kBad) {
        Bench b(cornell(), {"-i light"});
        b.scene.emitters[0].radiance.value.y = value;
        b.run();
        CHECK(b.count("light_generate", which) > 200);
        CHECK(b.total() == 0);
    }
}

TEST_CASE("G9: light_extend counts rays that are not finite", "[bidirectional]") {
    Bench b(cornell());
    b.run("light_extend", [](Bench& x) {
        edit<SubpathRay<BidirectionalMis>>(x.memory.subpaths.rays[0], 3, [](auto& r) { r.direction.y = kNan; });
        edit<SubpathRay<BidirectionalMis>>(x.memory.subpaths.rays[0], 5, [](auto& r) { r.origin.x = kInf; });
    });
    b.check_counts("light_extend", 2, 0, 0);
}

TEST_CASE("G9: light_shade counts throughput that is no light, and neither of its vertices reaches the film",
          "[bidirectional]") {
    for (auto [value, which] : kBad) {
        Bench b(cornell(), {"-i light"});
        b.run("light_shade", [v = value](Bench& x) {
            for (uint32_t i = 0; i < x.memory.subpaths.hits[0].counter->size(); ++i)
                edit<HitItem<SubpathRay<BidirectionalMis>>>(x.memory.subpaths.hits[0], i,
                                                            [v](auto& h) { h.ray.throughput.z = v; });
        });
        CHECK(b.count("light_shade", which) > 50);
        CHECK(b.count("connect_camera", which) > 50);
        for (const char* later : {"mis_weight", "occlude", "splat", "update_film"}) CHECK(b.count(later, which) == 0);
    }
}

TEST_CASE("G9: connect_camera counts vertices whose light is none", "[bidirectional]") {
    for (auto [value, which] : kBad) {
        Bench b(cornell());
        b.run("connect_camera", [v = value](Bench& x) {
            for (uint32_t i = 0; i < x.memory.splats.vertices.counter->size(); i += 2)
                edit<VertexItem<BidirectionalMis>>(x.memory.splats.vertices, i, [v](auto& y) { y.throughput.x = v; });
        });
        const uint64_t counted = b.count("connect_camera", which);
        CHECK(counted > 20);
        b.check_counts("connect_camera", which == 0 ? counted : 0, which == 1 ? counted : 0, which == 2 ? counted : 0);
        CHECK(b.total() > 0);
    }
}

TEST_CASE("G9: connect and connect_vertices count pairs whose light is none", "[bidirectional]") {
    for (auto [value, which] : kBad) {
        Bench b(cornell());
        b.run("generate", [v = value](Bench& x) {
            for (uint32_t i = 0; i < x.memory.light_vertices.counter->size(); i += 2)
                edit<ConnectionVertex<BidirectionalMis>>(x.memory.light_vertices, i,
                                                         [v](auto& y) { y.throughput.x = v; });
        });
        const uint64_t counted = b.count("connect_vertices", which);
        CHECK(counted > 100);
        b.check_counts("connect_vertices", which == 0 ? counted : 0, which == 1 ? counted : 0,
                       which == 2 ? counted : 0);
        CHECK(b.total() > 0);

        Bench e(cornell(), {"next_event"});
        e.run("connect", [v = value](Bench& x) {
            for (uint32_t i = 0; i < x.memory.eye.vertices.counter->size(); i += 2)
                edit<VertexItem<BidirectionalMis>>(x.memory.eye.vertices, i, [v](auto& z) { z.throughput.x = v; });
        });
        const uint64_t sampled = e.count("connect", which);
        CHECK(sampled > 20);
        e.check_counts("connect", which == 0 ? sampled : 0, which == 1 ? sampled : 0, which == 2 ? sampled : 0);
    }
}

TEST_CASE("G9: shade counts emission and throughput that are no light", "[bidirectional]") {
    for (auto [value, which] : kBad) {
        Bench b(lamp_seen(), {"hits"});
        b.scene.emitters[0].radiance.value.y = value;
        b.run();
        CHECK(b.count("shade", which) > 60);
        CHECK(b.total() == 0);
    }
}

TEST_CASE("G9: light that its weight takes below the range of floats is counted, light that others have is not") {
    StageRecord record{};
    Rgb weighted;
    CHECK_FALSE(weighted_light(splat(1.4e-45f), 9.0f, &record, weighted));
    CHECK(record.underflow == 1);
    CHECK_FALSE(weighted_light(splat(1e-30f), 1e30f, &record, weighted));
    CHECK(weighted_light(splat(1e-38f), 1.0f, &record, weighted));
    CHECK(record.underflow == 1);
    CHECK(record.nan + record.inf + record.negative == 0);
}

TEST_CASE("G9: mis_weight counts densities and splats that are none", "[bidirectional]") {
    Bench b(cornell());
    b.run("mis_weight", [](Bench& x) {
        edit<CandidateItem>(x.memory.splats.candidates, 0, [](CandidateItem& c) { c.ratio = kNan; });
        edit<CandidateItem>(x.memory.splats.candidates, 1, [](CandidateItem& c) { c.value.x = kInf; });
        edit<CandidateItem>(x.memory.splats.candidates, 2, [](CandidateItem& c) { c.value.x = -1; });
    });
    b.check_counts("mis_weight", 1, 1, 1);
}

TEST_CASE("B28: where other strategies are infinitely denser, a splat is nothing, not a NaN", "[bidirectional]") {
    Bench b(cornell());
    b.run("mis_weight", [](Bench& x) {
        for (uint32_t i = 0; i < x.memory.splats.candidates.counter->size(); ++i)
            edit<CandidateItem>(x.memory.splats.candidates, i, [](CandidateItem& c) { c.ratio = kInf; });
    });
    b.check_counts("", 0, 0, 0);
}

TEST_CASE("G9: occlude counts rays of splats that are not finite", "[bidirectional]") {
    Bench b(cornell());
    b.run("occlude", [](Bench& x) {
        edit<CandidateItem>(x.memory.splats.weighted, 0, [](CandidateItem& c) { c.direction.x = kNan; });
        edit<CandidateItem>(x.memory.splats.weighted, 1, [](CandidateItem& c) { c.origin.z = kInf; });
    });
    b.check_counts("occlude", 2, 0, 0);
}

TEST_CASE("G9: update_film counts samples that are no light", "[bidirectional]") {
    Bench b(cornell());
    b.run("update_film", [](Bench& x) {
        const float bad[3] = {kNan, kInf, -1e9f};
        for (uint32_t i = 0; i < 3; ++i) {
            const Rgb value = {bad[i], 0, 0};
            memcpy(&x.samples[i], &value, sizeof(value));
        }
    });
    b.check_counts("update_film", 1, 1, 1);
}

// ---- splats ----

namespace {

/// Film of a Bench without light of its own, with `splats` alone.
struct SplatFilm {
    Bench bench;
    explicit SplatFilm(const std::string& filter = "box", const std::string& crop = "")
        : bench(scene_from_text(scene_xml(1,
                                          "<sensor type='perspective'><film type='hdrfilm'><integer name='width' "
                                          "value='16'/><integer name='height' value='16'/>" +
                                              crop + "<rfilter type='" + filter +
                                              "'/></film></sensor><emitter type='point'/>")),
                {"light"}) {}
    void add(std::initializer_list<std::pair<Rgb, Vec2f>> items) {
        for (const auto& [value, film] : items) {
            bench.memory.splats.splats.push({value, 0, film, {}, 0.0f});
        }
        const Bench::Stages s = bench.stages();
        const uint32_t n = bench.memory.splats.splats.counter->size();
        for (uint32_t i = 0; i < n; ++i) s.splats.splat(i);
        bench.memory.splats.splats.counter->finish();
    }
    double at(uint32_t x, uint32_t y, uint32_t c = 0) const {
        return bench.splats[(size_t(y) * bench.wave.width + x) * 3 + c];
    }
    double total() const {
        double t = 0;
        for (size_t i = 0; i < bench.splats.size(); i += 3) t += bench.splats[i];
        return t;
    }
};

}  // namespace

TEST_CASE("B18: splats land in the pixel that they are in, whatever the border; outside nothing lands",
          "[bidirectional]") {
    for (auto [x, y, px, py] : {std::tuple{0.0f, 0.0f, 0, 0},
                                {0.5f, 0.5f, 0, 0},
                                {0.999f, 3.001f, 0, 3},
                                {1.0f, 2.0f, 1, 2},
                                {15.0f, 15.0f, 15, 15},
                                {15.999f, 15.999f, 15, 15},
                                {7.25f, 0.0f, 7, 0}}) {
        INFO(x << "," << y);
        SplatFilm f;
        f.add({{{1, 2, 3}, {x, y}}});
        CHECK(f.at(uint32_t(px), uint32_t(py), 0) == Approx(1));
        CHECK(f.at(uint32_t(px), uint32_t(py), 1) == Approx(2));
        CHECK(f.at(uint32_t(px), uint32_t(py), 2) == Approx(3));
        CHECK(f.total() == Approx(1));
    }
    for (auto [x, y] : {std::pair{-0.001f, 5.0f},
                        {16.0f, 5.0f},
                        {5.0f, -0.5f},
                        {5.0f, 16.0f},
                        {-1e30f, 5.0f},
                        {1e30f, 1e30f},
                        {kNan, 5.0f},
                        {5.0f, -kInf}}) {
        INFO(x << "," << y);
        SplatFilm f;
        f.add({{{1, 1, 1}, {x, y}}});
        CHECK(f.total() == 0);
    }
}

TEST_CASE("B19: a splat is spread by the filter: its energy is 1 on average, and it lands where the filter reaches",
          "[bidirectional]") {
    for (const char* filter : {"box", "tent", "gaussian"}) {
        INFO(filter);
        // The filter has an integral of 1: averaged over one pixel's positions, its sum over the pixels is 1.
        SplatFilm f(filter);
        const int n = 211;  // no multiple of the table's steps
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j)
                f.add({{{1, 1, 1}, {8 + (float(i) + 0.5f) / float(n), 8 + (float(j) + 0.5f) / float(n)}}});
        CHECK(f.total() / (n * n) == Approx(1).epsilon(2e-3));
        CHECK(f.at(7, 8) == Approx(f.at(9, 8)).epsilon(5e-3).margin(1e-6));
        CHECK(f.at(8, 7) == Approx(f.at(8, 9)).epsilon(5e-3).margin(1e-6));
        CHECK(f.at(7, 7) == Approx(f.at(9, 9)).epsilon(5e-3).margin(1e-6));
        for (uint32_t y = 0; y < 16; ++y)
            for (uint32_t x = 0; x < 16; ++x)
                if (std::abs(float(x) - 8.0f) > f.bench.scene.sensor.filter_radius + 0.5f) CHECK(f.at(x, y) == 0);
    }
}

TEST_CASE("B16: splats on a crop are those on the whole film there", "[bidirectional]") {
    SplatFilm whole("gaussian");
    SplatFilm part("gaussian",
                   "<integer name='crop_offset_x' value='5'/><integer name='crop_offset_y' value='3'/><integer "
                   "name='crop_width' value='4'/><integer name='crop_height' value='9'/>");
    for (int i = 0; i < 200; ++i) {
        const Vec2f at = {float(i * 37 % 160) / 10.0f, float(i * 53 % 160) / 10.0f};
        whole.add({{{1, 1, 1}, at}});
        part.add({{{1, 1, 1}, at}});
    }
    for (uint32_t y = 0; y < 9; ++y)
        for (uint32_t x = 0; x < 4; ++x)
            CHECK(part.at(x, y) == Approx(whole.at(x + 5, y + 3)).epsilon(1e-6).margin(1e-9));
}

TEST_CASE("G1: splats are summed exactly, in any order, and keep what is small or large", "[bidirectional]") {
    SplatFilm f;
    const float values[3] = {0.1f, 1e-9f, 1e3f};
    for (int i = 0; i < 10000; ++i) f.add({{{values[0], values[1], values[2]}, {3.5f, 4.5f}}});
    // 24 bits times 10000 fit into the 53 of a double.
    for (uint32_t c = 0; c < 3; ++c) CHECK(f.at(3, 4, c) == 10000 * double(values[c]));

    for (const float unit : {1e-35f, 1e-12f, 6.7e7f, 1e30f}) {
        SplatFilm g;
        for (int i = 0; i < 40; ++i) g.add({{{unit, 3 * unit, 0}, {3.5f, 4.5f}}});
        CHECK(g.at(3, 4, 0) == 40 * double(unit));
        CHECK(g.at(3, 4, 1) == 40 * double(3 * unit));
    }
}

TEST_CASE("G9: a pixel that more light reaches than a float holds is dropped and counted where the film is updated",
          "[bidirectional]") {
    SplatFilm f;
    for (int i = 0; i < 40; ++i) f.add({{{2e37f, 1, 1}, {3.5f, 4.5f}}, {{1, 1, 1}, {5.5f, 4.5f}}});
    const UpdateFilm update = f.bench.update();
    for (uint32_t slot = 0; slot < f.bench.wave.tiles * kTilePixels; ++slot) update(slot);
    CHECK(f.bench.record("update_film").inf == 1);
    CHECK(f.bench.record("splat").inf == 0);
    CHECK(f.bench.sum[(4 * 16 + 3) * 3] == 0);
    CHECK(f.bench.sum[(4 * 16 + 5) * 3] == 40);
}
