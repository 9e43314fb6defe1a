// libs: ambilux_render ambilux_integrators ambilux_core
// What bdpt.auto=true makes of a pilot's figures: the work of a candidate and its variance, as arithmetic.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "render/selection.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("the work of a candidate is that of its subpaths, shadow rays and connections, in rays") {
    PilotWork w;
    w.eye_rays = 3;
    w.light_rays = 2;
    w.next_events = 5;
    w.splats = 7;
    w.vertices = 4;
    w.pairs = 100;
    w.pair_rays = 11;
    w.draws = 13;
    w.draw_rays = 6;
    const double eye = 3 + 0.8 * 5, light = 2 + 0.8 * 7;
    for (const bool cuda : {false, true}) {
        CAPTURE(cuda);
        // docs/performance.md
        const double pairs = (cuda ? 0.24 : 0.02) * 100 + (cuda ? 1.06 : 0.8) * 11,
                     draw = (cuda ? 0.12 : 0.07) * 13 + (cuda ? 1.06 : 0.8) * 6, all = cuda ? 1.2 : 1;
        const auto work = [&](const char* variant, float light_subpaths, const SelectionOffer& offer) {
            SelectionCandidate c;
            c.settings = {{"integrator", "bdpt"}, {"variant", variant}};
            c.pilot = {light_subpaths, offer.connect, offer.worth};
            c.offer = offer;
            return selection_work(w, c, cuda);
        };
        CHECK(work("wavefront", 0, {}) == Approx(eye));
        CHECK(work("wavefront", 0.25f, without_connections()) == Approx(all * (eye + 0.25 * light)));
        const SelectionOffer paired = {"", {}, true};
        CHECK(work("wavefront", 1, paired) == Approx(all * (eye + light + pairs)));
        CHECK(work("lvc", 4, {"", {}, true, 2, 2}) == Approx(all * (eye + 4 * light + 2 * draw)));
        CHECK(work("learned", 1, {"", {}, true, 4, 12, 1.5}) == Approx(all * 1.5 * (eye + light + 4 * draw)));
        // A light subpath for every vertex of an eye subpath but the first.
        CHECK(work("streaming", 1, paired) == Approx(all * (eye + light + pairs + 3 * 2)));
        CHECK(work("streaming", 1, without_connections()) == Approx(all * (eye + light)));
        w.vertices = 0.5;
        CHECK(work("streaming", 1, paired) == Approx(all * (eye + light + pairs)));
        w.vertices = 4;
    }
    RenderSettings automatic;
    automatic.integrator = "bdpt";
    automatic.automatic = true;
    // Four draws that learn take more than four that do not, and are worth more.
    for (const auto& [cuda, more, worth] : {std::tuple{false, 1.25, 12u}, {true, 1.75, 16u}}) {
        const std::vector<SelectionCandidate> all = selection_candidates(automatic, cuda);
        const auto named = [&](const std::string& name) {
            return *std::find_if(all.begin(), all.end(), [&](const SelectionCandidate& c) { return c.name == name; });
        };
        const SelectionCandidate learned = named("bdpt, learned, 4 connections"),
                                 lvc = named("bdpt, lvc, 4 connections");
        CHECK(selection_work(w, learned, cuda) == Approx(more * selection_work(w, lvc, cuda)));
        CHECK(learned.pilot.draws == worth);
        CHECK(lvc.pilot.draws == 4);
    }
}

TEST_CASE("a hundredth of the blocks, where the best of all candidates is worst, counts for none") {
    std::vector<std::vector<double>> variance = {std::vector<double>(200, 2), std::vector<double>(200, 3)};
    const auto set = [&](size_t block, double a, double b) {
        variance[0][block] = a;
        variance[1][block] = b;
    };
    set(7, 1000, 500);
    set(8, 1000, 1);
    set(9, 400, 600);
    set(10, 300, 301);
    const std::vector<double> kept = trimmed_means(variance);
    REQUIRE(kept.size() == 2);
    CHECK(kept[0] == Approx((196 * 2 + 1000 + 300) / 198.0));
    CHECK(kept[1] == Approx((196 * 3 + 1 + 301) / 198.0));
    for (std::vector<double>& of : variance) of.resize(99);
    CHECK(trimmed_means(variance)[1] == Approx((95 * 3 + 500 + 1 + 600 + 301) / 99.0));
    CHECK(trimmed_means({{0, 0}, {1, 0}}) == std::vector<double>{1e-12, 0.5});
}

TEST_CASE("what no pilot sees counts for all candidates alike: a fifth of the median") {
    Pilot pilot;
    pilot.variance = {{10}, {1}, {4}};
    const std::vector<double> all = selection_variances(pilot, {"", "", ""});
    REQUIRE(all.size() == 3);
    CHECK(all[0] == Approx(10.8));
    CHECK(all[1] == Approx(1.8));
    CHECK(all[2] == Approx(4.8));
    // One that cannot be chosen tells nothing of the others.
    const std::vector<double> two = selection_variances(pilot, {"", "cannot find paths", ""});
    CHECK(two[0] == Approx(12));
    CHECK(std::isinf(two[1]));
    CHECK(two[2] == Approx(6));
    CHECK(std::isinf(selection_variances(pilot, {"a", "b", "c"})[0]));
}
