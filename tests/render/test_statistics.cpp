// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// timeout: 60
// From the records of stages to the statistics of a render.
#include <algorithm>

#include "film/strategy_film.h"
#include "queues/layout.h"
#include "render/fused_shares.h"
#include "render/statistics.h"

#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("Values dropped by a stage that runs as part of another count, though it has no launch and no item") {
    std::vector<StageRecord> records(2);
    records[0].launches = 1;
    records[0].items = 7;
    records[1].inf = 2;
    records[1].underflow = 3;
    RenderStats stats;
    fill_stage_stats({"shade", "connect"}, records, stats);
    CHECK(stats.stages.size() == 1);
    CHECK(stats.invalid.inf == 2);
    CHECK(stats.invalid.underflow == 3);
    CHECK(stats.invalid.total() == 2);  // what is below the range of floats is no error by itself
    CHECK(stats.invalid_by_stage.size() == 1);
    CHECK(stats.invalid_by_stage["connect"].underflow == 3);
}

TEST_CASE("NaN, infinite and negative values are errors, each counted for its stage and in all") {
    CHECK(InvalidCounts{1, 2, 4, 8}.total() == 7);
    std::vector<StageRecord> records(3);
    records[0].nan = 1, records[0].inf = 2, records[0].negative = 4, records[0].underflow = 8;
    records[2].nan = 16, records[2].inf = 32, records[2].negative = 64, records[2].underflow = 128;
    RenderStats stats;
    fill_stage_stats({"shade", "occlude", "connect"}, records, stats);
    const auto is = [](const InvalidCounts& c, uint64_t nan, uint64_t inf, uint64_t negative, uint64_t underflow) {
        return c.nan == nan && c.inf == inf && c.negative == negative && c.underflow == underflow;
    };
    CHECK(is(stats.invalid, 17, 34, 68, 136));
    REQUIRE(stats.invalid_by_stage.size() == 2);
    CHECK(is(stats.invalid_by_stage["shade"], 1, 2, 4, 8));
    CHECK(is(stats.invalid_by_stage["connect"], 16, 32, 64, 128));
}

TEST_CASE("Stages are listed as light goes through them, those that only an integrator knows before weights") {
    const std::vector<std::string> order = {
        "megakernel", "light_generate", "light_extend",     "light_shade", "connect_camera", "generate",   "extend",
        "shade",      "connect",        "connect_vertices", "its own",     "another",        "mis_weight", "occlude",
        "accumulate", "splat",          "update_film"};
    std::vector<std::string> names(order.rbegin(), order.rend());
    std::swap(*std::find(names.begin(), names.end(), "its own"), *std::find(names.begin(), names.end(), "another"));
    std::vector<StageRecord> records(names.size());
    for (size_t i = 0; i < names.size(); ++i) {
        records[i].launches = i + 1;
        records[i].items = 100 * (i + 1);
        records[i].nanoseconds = 1'000'000'000ull * (i + 1);
        records[i].items_by_depth[i] = 7;
    }
    RenderStats stats;
    fill_stage_stats(names, records, stats);
    REQUIRE(stats.stages.size() == order.size());
    for (size_t k = 0; k < order.size(); ++k) {
        const StageStats& s = stats.stages[k];
        CHECK(s.name == order[k]);
        const size_t i = size_t(std::find(names.begin(), names.end(), s.name) - names.begin());
        CHECK(s.launches == i + 1);
        CHECK(s.items == 100 * (i + 1));
        CHECK(s.seconds == Approx(double(i + 1)));
        std::vector<uint64_t> by_depth(i + 1);
        by_depth[i] = 7;
        CHECK(std::equal(s.items_by_depth.begin(), s.items_by_depth.end(), by_depth.begin(), by_depth.end()));
    }
    const auto items = [&](const char* name) {
        return 100 * uint64_t(std::find(names.begin(), names.end(), name) - names.begin() + 1);
    };
    CHECK(stats.rays_extend == items("extend") + items("light_extend"));
    CHECK(stats.rays_occlude == items("occlude"));
}

TEST_CASE("A stage without launches and items is not listed") {
    std::vector<StageRecord> records(3);
    records[0].launches = 1;
    records[2].items = 1;
    RenderStats stats;
    fill_stage_stats({"extend", "shade", "occlude"}, records, stats);
    REQUIRE(stats.stages.size() == 2);
    CHECK(stats.stages[0].name == "extend");
    CHECK(stats.stages[0].items_by_depth.empty());
    CHECK(stats.stages[1].name == "occlude");
    CHECK(stats.rays_occlude == 1);
}

TEST_CASE("What is below the range of floats is counted for its stage though nothing else is dropped there") {
    std::vector<StageRecord> records(2);
    records[0].underflow = 1;
    records[1].nan = records[1].underflow = 1;
    RenderStats stats;
    fill_stage_stats({"shade", "connect"}, records, stats);
    CHECK(stats.invalid_by_stage.size() == 2);
    CHECK(stats.stages.empty());
}

TEST_CASE("Queues are as full as in the fullest wave, and lose what all waves lost") {
    const Layout plan = [] {
        Layout l;
        l.allocate<uint32_t>(3);
        l.queue<Lane>("rays", 70);
        l.queue<Lane>("hits", 5);
        return l;
    }();
    std::vector<QueueCounter> a(2), b(2);
    a[0].peak = 60, a[1].peak = 2;
    b[0].peak = 50, b[1].peak = 4;
    a[0].overflow = 1, b[0].overflow = 10, b[1].overflow = 100;
    RenderStats stats;
    fill_queue_stats(plan, {a.data(), b.data()}, stats);
    REQUIRE(stats.queues.size() == 2);
    const auto is = [](const QueueStats& q, const char* name, uint64_t capacity, uint64_t peak, uint64_t overflow) {
        return q.name == name && q.capacity == capacity && q.peak == peak && q.overflow == overflow;
    };
    CHECK(is(stats.queues[0], "rays", 70, 60, 11));
    CHECK(is(stats.queues[1], "hits", 5, 4, 100));
}

TEST_CASE("Images of single strategies are means, raw and weighted, from the shortest paths on") {
    constexpr uint32_t kDepth = 2, kValues = 300, kStrategies = 6;
    REQUIRE(StrategyFilm::images(kDepth, true) == kStrategies);
    REQUIRE(strategy_values(kStrategies, 100) == 2 * kValues * kStrategies);
    std::vector<double> sums(2 * kValues * kStrategies);
    for (size_t i = 0; i < sums.size(); ++i) sums[i] = 100 + double(i);
    const std::vector<uint64_t> dropped = {7, 0, 5, 6, 8, 9};
    const std::pair<uint32_t, uint32_t> names[kStrategies] = {{0, 2}, {1, 1}, {0, 3}, {1, 2}, {2, 1}, {2, 2}};
    for (const uint64_t samples : {4, 0}) {
        const std::vector<StrategyImage> images = strategy_images(kDepth, samples, sums, dropped);
        REQUIRE(images.size() == kStrategies);
        for (size_t k = 0; k < kStrategies; ++k) {
            CAPTURE(k);
            CHECK(images[k].s == names[k].first);
            CHECK(images[k].t == names[k].second);
            CHECK(images[k].merge == (k == 5));
            CHECK(images[k].dropped == dropped[k]);
            REQUIRE(images[k].raw.size() == kValues);
            REQUIRE(images[k].weighted.size() == kValues);
            for (size_t i = 0; i < kValues; ++i) {
                const size_t at = 2 * kValues * k + i;
                CHECK(images[k].raw[i] == (samples ? (100 + float(at)) / 4 : 0));
                CHECK(images[k].weighted[i] == (samples ? (100 + float(at + kValues)) / 4 : 0));
            }
        }
    }
    CHECK(strategy_images(0, 4, {}, {}).empty());
}

TEST_CASE("A batch takes a fifth of a second, if a sample is known to take less, and is never too large") {
    CHECK(batch_of(0, 0) == 1);
    CHECK(batch_of(0, 4) == 1);
    CHECK(batch_of(1e-3, 0) == 1);
    CHECK(batch_of(0.125, 5) == 8);
    CHECK(batch_of(0.125, 1) == 1);
    CHECK(batch_of(0.02, 1) == 10);
    CHECK(batch_of(0.02, 100) == 1000);
    CHECK(batch_of(10, 1) == 1);
    CHECK(batch_of(1e-9, 1000) == 65536);
}

TEST_CASE("A sampled clock below zero is no time") {
    std::vector<StageRecord> records(1);
    records[0].launches = 1;
    records[0].nanoseconds = uint64_t(int64_t(-5));
    RenderStats stats;
    fill_stage_stats({"shade"}, records, stats);
    CHECK(stats.stages.at(0).seconds == 0);
}

TEST_CASE("Stages inside of others share the time of those around them as they do in a render without fusion") {
    const auto stage = [](const char* name, double seconds) {
        StageStats s;
        s.name = name;
        s.seconds = seconds;
        return s;
    };
    const std::vector<StageStats> fused = {stage("extend", 2), stage("shade", 6), stage("occlude", 3),
                                           stage("splat", 1)};
    const std::vector<StageStats> unfused = {stage("generate", 1), stage("extend", 3),     stage("shade", 4),
                                             stage("connect", 2),  stage("mis_weight", 1), stage("occlude", 4),
                                             stage("splat", 9),    stage("accumulate", 1)};
    const std::vector<FusedShare> found = fused_shares(fused, unfused);
    const auto share = [&](const char* name, const char* inside) {
        for (const FusedShare& s : found)
            if (s.stage == name && s.inside == inside) return s;
        FAIL(name << " in " << inside);
        return FusedShare{};
    };
    CHECK(share("generate", "extend").seconds == Approx(0.5));
    CHECK(share("extend", "extend").share == Approx(0.75));
    // accumulate: 1 second, half of it in either, whose own times are equal; mis_weight in shade alone.
    CHECK(share("shade", "shade").seconds == Approx(6 * 4 / 7.5));
    CHECK(share("connect", "shade").seconds == Approx(6 * 2 / 7.5));
    CHECK(share("mis_weight", "shade").seconds == Approx(6 * 1 / 7.5));
    CHECK(share("accumulate", "shade").seconds == Approx(6 * 0.5 / 7.5));
    CHECK(share("accumulate", "occlude").seconds == Approx(3 * 0.5 / 4.5));
    CHECK(found.size() == 8);
    for (const char* host : {"extend", "shade", "occlude"}) {
        double sum = 0;
        for (const FusedShare& s : found) sum += s.inside == host ? s.seconds : 0;
        for (const StageStats& s : fused)
            if (s.name == host) CHECK(sum == Approx(s.seconds));
    }
}

TEST_CASE("Stages with clocks of their own share no time") {
    StageStats shade, connect;
    shade.name = "shade", shade.seconds = 2;
    connect.name = "connect", connect.seconds = 1;
    CHECK(fused_shares({shade, connect}, {shade, connect}).empty());
}
