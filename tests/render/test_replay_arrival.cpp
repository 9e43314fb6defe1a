// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// What becomes of light in a replay: it arrives, or is told to have been blocked, culled, nothing or invalid.
#include "render/replay/arrival.h"

#include <cmath>

#include "tests/support/replay_settings.h"

namespace ambilux {
namespace {

/// Between the blocks of "cornell" and its open front, towards which the way is free; behind is a wall.
CandidateItem candidate_item(Rgb value, float ratio, float towards) {
    CandidateItem c{};
    c.value = value;
    c.ratio = ratio;
    c.strategy = Strategy::make(1, 2);
    c.origin = {0, 0.5f, 0.5f};
    c.direction = {0, 0, towards};
    c.tmax = 3;
    c.film = {1.5f, 2.5f};
    return c;
}

/// What became of a candidate, in a word; where a stage dropped it, which and why.
std::string fate(const ReplayCandidate& c) {
    switch (c.fate) {
        case ReplayFate::arrived: return "arrived";
        case ReplayFate::blocked: return "blocked";
        case ReplayFate::culled: return "culled";
        case ReplayFate::zero: return "zero";
        default: return c.drop.stage + " " + c.drop.what;
    }
}

const float kNan = std::nanf("");

}  // namespace

TEST_CASE("Light is told to arrive, to be blocked, culled, nothing or invalid, and is added only if it arrives") {
    const Scene scene = project_scene("cornell", 8, 8);
    SharedAccels accels(scene);
    ReplayContext<UnidirectionalMis> ctx{scene.view(), HostTracer(accels.get<EmbreeAccel>()->tracer()), {}, 0, false};
    EyeArrival<UnidirectionalMis> arrival(ctx);
    const auto light = [&](Rgb value, float ratio, float towards) {
        ReplayCandidate out;
        arrival.light(candidate_item(value, ratio, towards), out);
        CHECK(out.origin.y == 0.5f);
        CHECK((out.direction.z == towards || towards != towards));
        CHECK(out.tmax == 3);
        CHECK(out.strategy.code == Strategy::make(1, 2).code);
        if (ratio == ratio) CHECK(out.weight == 1 / (1 + ratio));
        if (out.fate != ReplayFate::arrived) CHECK(is_zero(out.contribution));
        return fate(out);
    };
    const auto emission = [&](Rgb value, float ratio) {
        ReplayCandidate out;
        arrival.emission({value, ratio, Strategy::make(0, 2), {}, {}, 0, {}, false}, out);
        CHECK(out.strategy.code == Strategy::make(0, 2).code);
        if (out.fate == ReplayFate::arrived) CHECK(out.contribution.x == value.x * out.weight);
        return fate(out);
    };
    CHECK(light({1, 2, 3}, 1, 1) == "arrived");
    CHECK(arrival.sum().x == 0.5f);
    CHECK(arrival.sum().z == 1.5f);
    CHECK(light({1, 2, 3}, 1, -1) == "blocked");
    CHECK(light({1e-30f, 0, 0}, 1e20f, 1) == "zero");
    CHECK(light({1, 1, 1}, kNan, 1) == "mis_weight NaN");
    CHECK(light({kInfinity, 1, 1}, 1, 1) == "mis_weight Inf");
    CHECK(light({-1, 1, 1}, 1, 1) == "mis_weight negative");
    CHECK(light({1, 1, 1}, 1, kNan) == "occlude NaN");
    CHECK(emission({kInfinity, 1, 1}, 1) == "shade Inf");
    CHECK(emission({1, kNan, 1}, 1) == "shade NaN");
    CHECK(emission({1, 1, -1}, 1) == "shade negative");
    CHECK(emission({1, 1, 1}, kNan) == "mis_weight NaN");
    CHECK(emission({1e-30f, 0, 0}, 1e20f) == "zero");
    CHECK(arrival.sum().x == 0.5f);
    CHECK(emission({2, 2, 2}, 3) == "arrived");
    CHECK(arrival.sum().x == 1);
    CHECK(arrival.sum().y == 1.5f);
    // A millionth of what came before.
    ctx.cull = 1;
    CHECK(light({1e-6f, 1e-6f, 1e-6f}, 0, 1) == "culled");
    CHECK(light({2, 2, 2}, 0, 1) == "arrived");
    CHECK(arrival.sum().x == 3);
}

TEST_CASE("A splat is told to arrive, to be blocked, nothing or invalid") {
    const Scene scene = project_scene("cornell", 8, 8);
    SharedAccels accels(scene);
    const ReplayContext<BidirectionalMis> ctx{
        scene.view(), HostTracer(accels.get<EmbreeAccel>()->tracer()), {}, 0, false};
    const auto splat = [&](Rgb value, float ratio, float towards) {
        ReplayCandidate out;
        splat_arrival(ctx, candidate_item(value, ratio, towards), out);
        CHECK(out.film.x == 1.5f);
        CHECK(out.film.y == 2.5f);
        CHECK(out.origin.y == 0.5f);
        CHECK(out.tmax == 3);
        CHECK(out.strategy.code == Strategy::make(1, 2).code);
        if (ratio == ratio) CHECK(out.weight == 1 / (1 + ratio));
        const bool arrived = out.fate == ReplayFate::arrived;
        CHECK(out.contribution.x == (arrived ? value.x * out.weight : 0));
        return fate(out);
    };
    CHECK(splat({1, 2, 3}, 3, 1) == "arrived");
    CHECK(splat({1, 2, 3}, 3, -1) == "blocked");
    CHECK(splat({1e-30f, 0, 0}, 1e20f, 1) == "zero");
    CHECK(splat({1, 1, 1}, kNan, 1) == "mis_weight NaN");
    CHECK(splat({1, 1, 1}, 3, kNan) == "occlude NaN");
}

TEST_CASE("A sample is the sum of both sides, and dropped if that is no radiance in any channel") {
    for (int c = 0; c < 3; ++c) {
        ReplaySample s;
        s.eye_sum = {1, 2, 3};
        for (int k = 0; k < 3; ++k) s.splat_sum[k] = 0.25;
        finish(s);
        CHECK_FALSE(s.drop.happened());
        for (int k = 0; k < 3; ++k) CHECK(s.total[k] == k + 1.25);
        s.splat_sum[c] = 1e39;
        finish(s);
        CHECK(s.drop.stage == "update_film");
        CHECK(s.drop.what == "Inf");
    }
}

TEST_CASE("Of invalid values a watch keeps the first, by what it is") {
    DropWatch watch;
    ReplayDrop drop;
    const auto see = [&](Rgb value) {
        (void)is_valid_radiance(value, watch.record());
        return watch.dropped("shade", drop);
    };
    CHECK_FALSE(see({1, 2, 3}));
    CHECK_FALSE(drop.happened());
    CHECK(see({1, -2, 3}));
    CHECK(drop.what == "negative");
    CHECK(see({1, kNan, 3}));
    CHECK(drop.what == "negative");
    CHECK_FALSE(see({1, 2, 3}));
    drop = {};
    CHECK(see({kInfinity, kNan, 3}));
    CHECK(drop.what == "NaN");
    CHECK(drop.stage == "shade");
    // However many of each kind there are.
    for (const uint64_t nan : {0, 1, 2})
        for (const uint64_t inf : {0, 1, 2})
            for (const uint64_t negative : {0, 1, 2}) {
                CAPTURE(nan, inf, negative);
                StageRecord& record = *watch.record();
                record.nan = nan;
                record.inf = inf;
                record.negative = negative;
                record.underflow = 1;
                drop = {};
                CHECK(watch.dropped("occlude", drop) == (nan + inf + negative > 0));
                CHECK(drop.what == (nan ? "NaN" : inf ? "Inf" : negative ? "negative" : ""));
            }
}

TEST_CASE("The largest of a contribution is that of its largest channel") {
    CHECK(largest({3, 1, 2}) == 3);
    CHECK(largest({1, 0.25f, 0}) == 1);
    CHECK(largest({0, 1, 0.5f}) == 1);
    CHECK(largest({0, 1, 2.5f}) == 2.5);
}

}  // namespace ambilux
