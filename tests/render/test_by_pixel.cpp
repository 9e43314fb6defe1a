// libs: ambilux_render ambilux_integrators ambilux_core
// Numbers of connections for each block of pixels from a pilot's figures, against all maps there are.
#include "render/by_pixel.h"

#include <cmath>

#include "core/rng.h"
#include "integrators/bdpt/aware/settings.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// Two halves of a film, each alike: in one, connections find all light, in the other they find none.
BlockFigures halves(uint32_t width, uint32_t height) {
    BlockFigures of = {width, height, {}, {}};
    for (const double draws : {0.0, 1.0, 2.0, 4.0, 8.0}) {
        of.variance.emplace_back();
        of.work.emplace_back();
        for (uint32_t y = 0; y < height; ++y)
            for (uint32_t x = 0; x < width; ++x) {
                of.variance.back().push_back(x < width / 2 ? 9.0 / (1.0 + draws) : 1.0);
                of.work.back().push_back(10.0 + draws);
            }
    }
    return of;
}

double product(const BlockFigures& of, const std::vector<uint32_t>& option, double unseen) {
    double variance = 0, work = 0;
    for (size_t b = 0; b < option.size(); ++b) {
        variance += of.variance[option[b]][b] / double(option.size());
        work += of.work[option[b]][b] / double(option.size());
    }
    return (variance + unseen) * work;
}

}  // namespace

TEST_CASE("Blocks where connections find the light have many, others none, and the product is the least of all") {
    constexpr uint32_t kWidth = 240, kBlocks = kWidth * 4;
    const BlockFigures of = halves(kWidth, 4);
    for (const double unseen : {0.0, 0.5}) {
        const std::vector<uint32_t> option = options_by_block(of, unseen);
        // Away from the border, where means over neighbours lie between: 4 columns of 240.
        for (uint32_t b = 0; b < kBlocks; ++b) {
            if (b % kWidth < kWidth / 2 - 2) CHECK(option[b] == option[0]);
            if (b % kWidth >= kWidth / 2 + 2) CHECK(option[b] == 0);
        }
        CHECK(option[0] >= 3);
        double best = kInfinity;
        for (uint32_t left = 0; left < 5; ++left)
            for (uint32_t right = 0; right < 5; ++right) {
                std::vector<uint32_t> all(kBlocks);
                for (uint32_t b = 0; b < all.size(); ++b) all[b] = b % kWidth < kWidth / 2 ? left : right;
                best = std::min(best, product(of, all, unseen));
                if (left == right) CHECK(product(of, option, unseen) < product(of, all, unseen));
            }
        CHECK(product(of, option, unseen) < 1.02 * best);
    }
}

TEST_CASE("Of noisy figures no choice is worse than the best number for all, as neighbours see them") {
    for (uint32_t seed = 0; seed < 20; ++seed) {
        BlockFigures of = halves(16, 16);
        for (size_t b = 0; b < 256; ++b) {
            const double noise = -std::log(1.0 - double(random_floats({seed, uint32_t(b), 0, Stream::test}, 0).x));
            for (auto& v : of.variance) v[b] = noise * (1.0 + v[b]);
        }
        const std::vector<uint32_t> option = options_by_block(of, 0.0);
        double best = kInfinity;
        for (uint32_t o = 0; o < 5; ++o) best = std::min(best, product(of, std::vector<uint32_t>(256, o), 0.0));
        CHECK(product(of, option, 0.0) < best);
    }
}

TEST_CASE("One number for all pixels is no map, and excluded candidates are in none") {
    RenderSettings automatic;
    automatic.integrator = "bdpt";
    automatic.automatic = true;
    CHECK(selection_candidates(automatic, false).size() == 23);
    automatic.selector = Selector::efficiency;
    std::vector<SelectionCandidate> all = selection_candidates(automatic, false);
    REQUIRE(all.size() == 26);
    const size_t own = 24;
    REQUIRE(all[own].offer.by_pixel);
    REQUIRE(all[own].pilot.light_subpaths == 1.0f);
    Pilot pilot;
    pilot.blocks_x = 12;
    pilot.blocks_y = 4;
    PilotWork w;
    w.eye_rays = w.draws = w.draw_rays = 1;
    pilot.block_work.assign(48, w);
    std::vector<std::string> excluded(all.size());
    for (size_t c = 0; c < 23; ++c) {
        const double draws = all[c].offer.draws;
        std::vector<double>& v = pilot.variance.emplace_back();
        for (uint32_t b = 0; b < 48; ++b) v.push_back(b % 12 < 6 ? 9.0 / (1.0 + draws) : 1.0);
    }
    const auto map_of = [&](SelectionCandidate c, Pilot p) {
        const double work = set_connections_map(c, all, excluded, false, 0.0, p);
        CHECK(p.variance.size() == 24);
        const std::string text = c.settings.back().first == "connections_map" ? c.settings.back().second : "";
        CHECK((work > 0) == !text.empty());
        return ConnectionsMap::parse(text);
    };
    const ConnectionsMap map = map_of(all[own], pilot);
    REQUIRE((map.x == 12 && map.y == 4));
    CHECK(map.least() == 0);
    CHECK(map.most() == 2);  // (9 / 3 + 1) / 2 · (1 + 0.87 · 2 / 2) = 3.74; with 1: 3.95, with 4: 3.84
    for (size_t c = 0; c < 23; ++c)
        if (!all[c].offer.connect && all[c].pilot.light_subpaths == 1.0f) excluded[c] = "finds too little";
    CHECK(map_of(all[own], pilot).least() == 1);
    for (auto& v : pilot.variance) std::fill(v.begin(), v.end(), 1.0);
    CHECK(map_of(all[own], pilot).counts.empty());
}
