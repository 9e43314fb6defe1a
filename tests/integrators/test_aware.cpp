// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 600
// long: tagged
// Variant aware of bdpt: a number of connections for each pixel.
#include <cmath>

#include "core/error.h"
#include "integrators/bdpt/aware/settings.h"
#include "tests/support/bidirectional_images.h"
#include "tests/support/long_run.h"

using namespace ambilux;

namespace {

/// Blocks that divide no film of these tests evenly.
constexpr const char* kMap = "7x5:01248102481024810248102481024810248";
/// For scenes with light that connections alone find.
constexpr const char* kEverywhere = "7x5:11248142481424812248122481124818248";

RenderSettings settings_of(const Scene& scene, const std::string& variant, uint64_t seed, const std::string& map = "") {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.integrator = "bdpt";
    s.variant = variant;
    if (!map.empty()) apply_setting(s, "connections_map", map);
    return s;
}

}  // namespace

TEST_CASE("Whatever the map, images have the expectation of paired subpaths") {
    for (const char* name : first_or_all<const char*>(3, {"cornell", "materials", "glass", "lights", "shade"})) {
        const Scene scene = project_scene(name, 40, 30);
        // Hits of the lamp by way of the sphere are rare and the same for both variants.
        const char* strategies = name == std::string("glass") ? "next_event+connections+light" : "all";
        RenderSettings reference = settings_of(scene, "wavefront", 21);
        apply_setting(reference, "strategies", strategies);
        const Estimate paired = render_batches(scene, reference, 512);
        for (const MisHeuristic heuristic : {MisHeuristic::balance, MisHeuristic::power}) {
            RenderSettings s = settings_of(scene, "aware", 22, name == std::string("glass") ? kEverywhere : kMap);
            apply_setting(s, "strategies", strategies);
            s.heuristic = heuristic;
            if (heuristic == MisHeuristic::power) apply_setting(s, "light_paths", "0.25");
            INFO(name << ", heuristic " << int(heuristic));
            check_agreement(scene, s, 256, paired, 0.08);
        }
    }
}

TEST_CASE("Connections and light tracing alone, and stages with queues of their own") {
    const Scene scene = project_scene("cornell", 32, 32);
    RenderSettings s = settings_of(scene, "wavefront", 31);
    apply_setting(s, "strategies", "connections+light");
    s.max_depth = 4;
    const Estimate paired = render_batches(scene, s, 256);
    RenderSettings own = settings_of(scene, "aware", 32, kEverywhere);
    apply_setting(own, "strategies", "connections+light");
    own.max_depth = 4;
    check_agreement(scene, own, 256, paired, 0.06);
    check_stages_of_their_own(scene, own, 5);
}

TEST_CASE("With the same number for all pixels images are those of lvc, sample by sample") {
    for (const char* name : {"cornell", "materials", "glass"}) {
        const Scene scene = project_scene(name, 40, 30);
        for (const uint32_t connections : {1u, 4u}) {
            RenderSettings lvc = settings_of(scene, "lvc", 7), aware = settings_of(scene, "aware", 7);
            lvc.connections = aware.connections = connections;
            const RenderResult a = render_scene(scene, lvc, 8), b = render_scene(scene, aware, 8);
            const auto digit = settings_of(scene, "aware", 7, "2x1:" + std::string(2, char('0' + connections)));
            CHECK(render_scene(scene, digit, 8).film.sum == b.film.sum);
            double difference = 0, sum = 0;
            for (size_t i = 0; i < a.film.sum.size(); ++i) {
                difference += std::abs(double(a.film.sum[i]) - double(b.film.sum[i]));
                sum += double(a.film.sum[i]);
            }
            INFO(name << ", " << connections);
            CHECK(difference < 1e-5 * sum);  // weights are added up in another order
        }
    }
}

TEST_CASE("Pixels without connections make none, and no map without them has any") {
    const Scene scene = project_scene("cornell", 32, 32);
    const auto connections = [](const RenderResult& r) {
        for (const StageStats& stage : r.stats.stages)
            if (stage.name == "connect_vertices") return stage.items;
        return uint64_t(0);
    };
    const uint64_t two = connections(render_scene(scene, settings_of(scene, "aware", 3, "2x1:22"), 8)),
                   left = connections(render_scene(scene, settings_of(scene, "aware", 3, "2x1:20"), 8)),
                   right = connections(render_scene(scene, settings_of(scene, "aware", 3, "2x1:02"), 8));
    CHECK(left > 0);
    CHECK(right > 0);
    CHECK(left + right == two);
    // What is left of bdpt is what `strategies` leaves, on the same random numbers.
    RenderSettings none = settings_of(scene, "aware", 3, "1x1:0"), plain = settings_of(scene, "wavefront", 3);
    apply_setting(plain, "strategies", "hits+next_event+light");
    const RenderResult a = render_scene(scene, none, 8), b = render_scene(scene, plain, 8);
    CHECK(connections(a) == 0);
    double difference = 0, sum = 0;
    for (size_t i = 0; i < a.film.sum.size(); ++i) {
        difference += std::abs(double(a.film.sum[i]) - double(b.film.sum[i]));
        sum += double(a.film.sum[i]);
    }
    CHECK(difference < 1e-5 * sum);
}

TEST_CASE("Bits depend on no order of threads and no memory, and memory is what was predicted") {
    const Scene scene = project_scene("materials", 64, 48);
    RenderSettings s = settings_of(scene, "aware", 5, kMap);
    const RenderResult a = render_scene(scene, s, 9), b = render_scene(scene, s, 9);
    CHECK(a.film.sum == b.film.sum);
    CHECK(a.film.sum_squares == b.film.sum_squares);
    CHECK(a.stats.memory_bytes == a.stats.memory_bytes_predicted);
    CHECK(a.stats.invalid.total() == 0);
    for (const QueueStats& q : a.stats.queues) CHECK(q.overflow == 0);
    // Resumed: the later samples are those of one render.
    const std::unique_ptr<Renderer> whole = make_renderer(scene, s), parts = make_renderer(scene, s);
    REQUIRE(whole->render(0, 9) == 9);
    REQUIRE(parts->render(0, 4) == 4);
    REQUIRE(parts->render(4, 5) == 5);
    CHECK(whole->film().sum == parts->film().sum);
}

TEST_CASE("Scenes without light vertices, and paths too short for connections") {
    for (const int depth : {0, 1, 2, 3}) {
        const Scene scene = project_scene("cornell", 16, 16);
        RenderSettings s = settings_of(scene, "aware", 5, kMap);
        s.max_depth = depth;
        CHECK(render_scene(scene, s, 4).stats.invalid.total() == 0);
    }
}

TEST_CASE("Maps are what their text says, and other texts are refused") {
    const ConnectionsMap map = ConnectionsMap::parse("3x2:012489");
    CHECK((map.x == 3 && map.y == 2));
    CHECK(map.counts == std::vector<uint16_t>{0, 1, 2, 4, 8, 9});
    CHECK(map.text() == "3x2:012489");
    CHECK((map.least() == 0 && map.most() == 9));
    CHECK(ConnectionsMap::parse("").counts.empty());
    for (const char* text : {"3x2", "3x2:01248", "3x2:0124890", "0x2:", "x2:11", "3x:111", "3x2:01248a", "-1x-1:1",
                             ":1", "2:1x1", "99999999999x1:1", "99999x99999:1"})
        CHECK_THROWS_AS(ConnectionsMap::parse(text), Error);
    const Scene scene = project_scene("cornell", 16, 16);
    RenderSettings lvc = settings_of(scene, "lvc", 1);
    CHECK_THROWS_AS((apply_setting(lvc, "connections_map", "1x1:1"), make_renderer(scene, lvc)), Error);
}
