// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 900
// seconds: 72
// Variants of bidirectional path tracing give the same image.
#include <algorithm>
#include <cmath>
#include <map>

#include "accel/cwbvh.h"
#include "core/error.h"
#include "film/splat_sums.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

RenderSettings variant_settings(const Scene& scene, const char* variant, uint64_t seed = 1) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.integrator = "bdpt";
    s.variant = variant;
    return s;
}

/// Pairs that were connected.
uint64_t pairs_of(const RenderResult& r) {
    for (const StageStats& stage : r.stats.stages)
        if (stage.name == "connect_vertices") return stage.items;
    return 0;
}

/// In glass, hits of the lamp by way of the sphere are so rare that they alone would decide about the number of
/// samples; the same for all variants, they are left out.
const char* strategies_of(const std::string& scene) {
    return scene == "glass" ? "next_event+connections+light" : "all";
}

/// What all variants must find, by paired subpaths; rendered once for all tests.
struct Paired {
    Scene scene;
    Estimate image;
};
const Paired& paired(const std::string& name) {
    static std::map<std::string, Paired> all;
    const auto known = all.find(name);
    if (known != all.end()) return known->second;
    Scene scene = project_scene(name, 40, 30);
    RenderSettings s = variant_settings(scene, "wavefront", 21);
    apply_setting(s, "strategies", strategies_of(name));
    Estimate image = render_batches(scene, s, 512);
    return all.emplace(name, Paired{std::move(scene), std::move(image)}).first->second;
}

/// Where connections matter most: alone with light tracing, on paths of three and four segments.
RenderSettings connected_settings(const Scene& scene, const char* variant, uint64_t seed) {
    RenderSettings s = variant_settings(scene, variant, seed);
    apply_setting(s, "strategies", "connections+light");
    s.max_depth = 4;
    return s;
}
const Paired& paired_connected() {
    static const Paired paired = [] {
        Scene scene = project_scene("cornell", 40, 40);
        Estimate image = render_batches(scene, connected_settings(scene, "wavefront", 31), 512);
        return Paired{std::move(scene), std::move(image)};
    }();
    return paired;
}

double worst_difference(const FilmMoments& a, const FilmMoments& b) {
    double mean = 0, worst = 0;
    for (const double v : b.sum) mean += v / double(b.sum.size());
    for (size_t i = 0; i < a.sum.size(); ++i)
        worst = std::max(worst, std::fabs(a.sum[i] - b.sum[i]) / std::max(std::fabs(b.sum[i]), mean));
    return worst;
}

}  // namespace

TEST_CASE("megakernel and wavefront sample the same paths: images equal up to rounding, rays equal") {
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured"}) {
        const Scene scene = project_scene(name, 64, 48);
        for (const char* strategies : {"all", "hits+next_event", "light", "connections+light", "s1t2+s2t2+s4t1"}) {
            INFO(name << " " << strategies);
            RenderSettings s = variant_settings(scene, "wavefront");
            apply_setting(s, "strategies", strategies);
            const RenderResult wavefront = render_scene(scene, s, 3);
            s.variant = "megakernel";
            const RenderResult megakernel = render_scene(scene, s, 3);
            CHECK(worst_difference(megakernel.film, wavefront.film) < 1e-4);
            CHECK(megakernel.stats.rays_extend == wavefront.stats.rays_extend);
            CHECK(megakernel.stats.rays_occlude == wavefront.stats.rays_occlude);
            CHECK(megakernel.stats.invalid.total() == 0);
        }
    }
}

TEST_CASE(
    "Light that is weighted and added up where it is found makes the image that stages of their own make, bit for "
    "bit") {
    for (const char* name : {"glass", "lights", "textured"}) {
        const Scene scene = project_scene(name, 48, 32);
        for (const char* variant : {"wavefront", "lvc", "streaming"}) {
            INFO(name << " " << variant);
            const auto [fused, staged] = check_stages_of_their_own(scene, variant_settings(scene, variant), 3);
            CHECK(fused.stats.rays_occlude == staged.stats.rays_occlude);
            CHECK(fused.stats.memory_bytes < staged.stats.memory_bytes);
            const auto weighs = [](const RenderResult& r) {
                return std::any_of(r.stats.stages.begin(), r.stats.stages.end(),
                                   [](const StageStats& t) { return t.name == "mis_weight" && t.launches > 0; });
            };
            CHECK_FALSE(weighs(fused));
            CHECK(weighs(staged));
        }
    }
}

TEST_CASE("An eye vertex may have one pair in a launch or several, or all at once") {
    for (const char* variant : {"wavefront", "lvc"}) {
        INFO(variant);
        const Scene scene = project_scene("cornell", 48, 32);
        RenderSettings s = variant_settings(scene, variant);
        if (s.variant == "lvc") s.connections = 7;
        s.specialise = false;  // stages of their own hold all features
        const RenderResult at_once = render_scene(scene, s, 3);
        s.fuse = Fuse::none;
        const RenderResult several = render_scene(scene, s, 3);
        s.deterministic = true;
        const RenderResult one = render_scene(scene, s, 3);
        CHECK(pairs_of(one) > 1000);
        // On the host all add in the same order.
        for (const RenderResult* other : {&several, &at_once}) {
            CHECK(other->film.sum == one.film.sum);
            CHECK(pairs_of(*other) == pairs_of(one));
            CHECK(other->stats.rays_occlude == one.stats.rays_occlude);
        }
    }
}

TEST_CASE("lvc has the expectation of paired subpaths, for few draws and many, and for both heuristics") {
    for (const char* name : first_or_all<const char*>(3, {"cornell", "lights", "materials", "glass"})) {
        const auto& [scene, expected] = paired(name);
        for (const uint32_t draws : first_or_all(name == std::string("cornell") ? 2 : 1, std::vector{5u, 1u})) {
            for (const MisHeuristic heuristic :
                 first_or_all<MisHeuristic>(1, {MisHeuristic::balance, MisHeuristic::power})) {
                RenderSettings s = variant_settings(scene, "lvc", 22);
                s.connections = draws;
                s.heuristic = heuristic;
                apply_setting(s, "strategies", strategies_of(name));
                INFO(name << " " << draws << " draws, heuristic " << int(heuristic));
                check_agreement(scene, s, 256, expected, 0.06);
            }
        }
    }
}

TEST_CASE("Light that is culled before its shadow ray keeps its expectation and saves rays") {
    for (const char* integrator : first_or_all<const char*>(1, {"bdpt", "path"})) {
        INFO(integrator);
        const Scene scene = project_scene("cornell", 40, 30);
        RenderSettings s = variant_settings(scene, "wavefront", 41);
        s.integrator = integrator;
        const Estimate without = render_batches(scene, s, 1024);
        const uint64_t rays = render_scene(scene, s, 4).stats.rays_occlude;
        s.cull = 0.005f;
        CHECK(render_scene(scene, s, 4).stats.rays_occlude < rays);
        s.seed = 42;
        s.cull = 0.5f;
        CHECK(render_scene(scene, s, 4).stats.rays_occlude < rays * 9 / 10);
        check_agreement(scene, s, 1024, without, 0.02);
    }
}

TEST_CASE("lvc: connections and light tracing alone, whose weights sum to one between them") {
    const auto& [scene, expected] = paired_connected();
    RenderSettings s = connected_settings(scene, "lvc", 32);
    s.connections = 4;
    check_agreement(scene, s, 512, expected, 0.02);
}

TEST_CASE(
    "where items lie and in which order stages go through them changes no bit of bidirectional images and no count") {
    for (const char* name : {"glass", "lights", "materials"}) {
        const Scene scene = project_scene(name, 61, 43);
        for (const char* variant : {"wavefront", "lvc", "streaming"}) {
            RenderSettings one_pair = variant_settings(scene, variant);
            one_pair.deterministic = true;  // contributions of one path are then added one launch after the other
            const RenderResult first = render_scene(scene, one_pair, 2);
            for (const char* compaction : {"atomic", "select", "none"}) {
                if (one_pair.variant == "streaming" && compaction != std::string("atomic")) continue;
                for (const char* ordering : {"none", "material", "morton"}) {
                    INFO(name << " " << variant << " compaction=" << compaction << " ordering=" << ordering);
                    RenderSettings s = one_pair;
                    apply_setting(s, "compaction", compaction);
                    apply_setting(s, "ordering", ordering);
                    const RenderResult result = render_scene(scene, s, 2);
                    s.deterministic = false;
                    for (const QueueStats& q : render_scene(scene, s, 2).stats.queues) CHECK(q.overflow == 0);
                    for (const QueueStats& q : result.stats.queues) CHECK(q.overflow == 0);  // no path pushed twice
                    CHECK(result.stats.invalid.total() == 0);
                    // The places in the cache, and with them what is drawn, are those of another order.
                    if (s.variant == "lvc" && s.queues.ordering != Ordering::none) continue;
                    CHECK(result.film.sum == first.film.sum);
                    REQUIRE(result.stats.stages.size() == first.stats.stages.size());
                    for (size_t k = 0; k < first.stats.stages.size(); ++k)
                        if (first.stats.stages[k].name !=
                            "update_film")  // once in every pass, of which a slow machine has more
                            CHECK(result.stats.stages[k].items_by_depth == first.stats.stages[k].items_by_depth);
                }
            }
        }
    }
}

TEST_CASE("lvc over sorted queues has the expectation of paired subpaths") {
    const auto& [scene, expected] = paired("materials");
    RenderSettings s = variant_settings(scene, "lvc", 52);
    for (const char* ordering : {"material", "morton"}) {
        apply_setting(s, "ordering", ordering);
        const ZTestResult result = z_test(render_batches(scene, s, 128), expected);
        INFO(ordering << "\n" << result.report());
        CHECK(result.pass);
    }
}

TEST_CASE("settings that would change nothing are refused") {
    const Scene scene = project_scene("cornell", 16, 16);
    struct Case {
        const char *integrator, *variant, *key, *value;
    };
    for (const Case& c : {Case{"path", "wavefront", "strategies", "hits"},
                          {"path", "wavefront", "strategies", "s1t2"},
                          {"path", "wavefront", "connections", "5"},
                          {"path", "wavefront", "light_paths", "2"},
                          {"light", "wavefront", "strategies", "light"},
                          {"light", "wavefront", "connections", "5"},
                          {"light", "wavefront", "estimator", "nee"},
                          {"bdpt", "wavefront", "connections", "5"},
                          {"bdpt", "streaming", "connections", "5"},
                          {"bdpt", "megakernel", "connections", "5"},
                          {"bdpt", "lvc", "estimator", "naive"}}) {
        INFO(c.integrator << " " << c.variant << " " << c.key);
        RenderSettings s = variant_settings(scene, c.variant);
        s.integrator = c.integrator;
        apply_setting(s, c.key, c.value);
        CHECK_THROWS_WITH(make_renderer(scene, s), StartsWith(c.key) && ContainsSubstring(c.integrator));
    }
}

TEST_CASE("compaction and ordering are refused where there are no such queues") {
    const Scene scene = project_scene("cornell", 16, 16);
    for (const char* variant : {"megakernel", "streaming"}) {
        for (const auto& [key, value] : {std::pair{"compaction", "select"},
                                         {"compaction", "none"},
                                         {"ordering", "material"},
                                         {"ordering", "morton"}}) {
            if (variant == std::string("streaming") && key == std::string("ordering")) continue;
            RenderSettings s = variant_settings(scene, variant);
            apply_setting(s, key, value);
            CHECK_THROWS_WITH(make_renderer(scene, s), ContainsSubstring(std::string(key) + "=" + value) &&
                                                           ContainsSubstring(variant) &&
                                                           ContainsSubstring("wavefront"));
        }
    }
}

TEST_CASE("streaming samples the paths of paired subpaths but for connections beyond the first eye vertex") {
    for (const char* name : {"cornell", "furnace", "glass", "lights", "materials", "textured"}) {
        for (const auto& [strategies, max_depth] : {std::pair{"hits+next_event", 6},
                                                    {"light", 6},
                                                    {"hits+next_event+light", 6},
                                                    {"connections", 3},
                                                    {"all", 3}}) {
            INFO(name << " " << strategies);
            Scene scene = project_scene(name, 61, 43);
            scene.integrator.max_depth = max_depth;
            RenderSettings s = variant_settings(scene, "wavefront");
            apply_setting(s, "strategies", strategies);
            const RenderResult wavefront = render_scene(scene, s, 3);
            s.variant = "streaming";
            const RenderResult streaming = render_scene(scene, s, 3);
            CHECK(worst_difference(streaming.film, wavefront.film) < 1e-4);
            CHECK(streaming.stats.invalid.total() == 0);
            for (const QueueStats& q : streaming.stats.queues) CHECK(q.overflow == 0);
        }
    }
}

TEST_CASE("streaming has the expectation of paired subpaths") {
    for (const char* name : first_or_all<const char*>(3, {"cornell", "lights", "materials", "glass"})) {
        const auto& [scene, expected] = paired(name);
        for (const MisHeuristic heuristic :
             first_or_all<MisHeuristic>(1, {MisHeuristic::balance, MisHeuristic::power})) {
            RenderSettings s = variant_settings(scene, "streaming", 42);
            s.heuristic = heuristic;
            apply_setting(s, "strategies", strategies_of(name));
            INFO(name << " heuristic " << int(heuristic));
            check_agreement(scene, s, 512, expected, 0.06);
        }
    }
    const auto& [scene, expected] = paired_connected();
    check_agreement(scene, connected_settings(scene, "streaming", 44), 512, expected, 0.02);
}

TEST_CASE("streaming: bits do not depend on the number of slots, nor memory on the length of paths") {
    Scene scene = project_scene("materials", 61, 43);
    std::vector<double> sums;
    for (const uint32_t wave_size : {64u, 512u, 4096u, 1u << 16}) {
        RenderSettings s = variant_settings(scene, "streaming");
        s.wave_size = wave_size;
        const RenderResult r = render_scene(scene, s, 2);
        if (sums.empty())
            sums = r.film.sum;
        else
            CHECK(r.film.sum == sums);
    }
    uint64_t bytes = 0;
    for (const int depth : {3, 8, 64, -1}) {
        RenderSettings s = variant_settings(scene, "streaming");
        s.max_depth = depth;
        const RenderResult r = render_scene(scene, s, 2);
        CHECK(r.stats.memory_bytes == r.stats.memory_bytes_predicted);
        if (bytes == 0)
            bytes = r.stats.memory_bytes;
        else
            CHECK(r.stats.memory_bytes == bytes);
    }
}

TEST_CASE("G13: variants that an integrator does not have are refused by name") {
    const Scene scene = project_scene("cornell", 16, 16);
    for (const auto& [integrator, variant] : {std::pair{"path", "megakernel"},
                                              {"path", "lvc"},
                                              {"light", "lvc"},
                                              {"light", "megakernel"},
                                              {"path", "streaming"},
                                              {"light", "streaming"}}) {
        RenderSettings s = variant_settings(scene, variant);
        s.integrator = integrator;
        try {
            make_renderer(scene, s);
            FAIL("not refused: " << integrator << " " << variant);
        } catch (const Error& error) {
            CHECK(error.code == ExitCode::usage);
            CHECK(std::string(error.what()).find(variant) != std::string::npos);
        }
    }
    RenderSettings s;
    CHECK_THROWS_AS(apply_setting(s, "variant", "stream"), Error);
    CHECK_THROWS_AS(apply_setting(s, "connections", "0"), Error);
    CHECK_THROWS_AS(apply_setting(s, "connections", "257"), Error);
}

TEST_CASE(
    "Sums of splats: cells of floats hold what cells of doubles hold, whatever the unit, and both can be emptied") {
    std::vector<double> doubles(6, 0);
    std::vector<Lane> floats(2, Lane{});
    const SplatSums kinds[2] = {{doubles.data(), nullptr}, {nullptr, floats.data()}};
    for (const float unit : {1e-30f, 1e-12f, 1.0f, 1e12f, 1e30f})
        for (const SplatSums& sums : kinds) {
            double expected[3] = {};
            for (int k = 0; k < 100; ++k) {
                const Rgb value = Rgb{0.5f + float(k), 1e-3f * float(k), 1e5f} * unit;
                sums.add(1, value, false);
                for (int c = 0; c < 3; ++c) expected[c] += double(value[c]);
            }
            double value[3];
            sums.read(1, value);
            for (int c = 0; c < 3; ++c)
                CHECK(value[c] == Approx(expected[c]).epsilon(sums.doubles ? 1e-14 : 100 * 0x1p-24));
            sums.clear(1);
            sums.read(1, value);
            for (int c = 0; c < 3; ++c) CHECK(value[c] == 0);
            sums.read(0, value);
            for (int c = 0; c < 3; ++c) CHECK(value[c] == 0);
        }
}
