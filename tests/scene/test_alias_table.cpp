// libs: ambilux_formats ambilux_accel
// Alias tables: every ticket drawn, counted exactly.
#include "scene/alias_table.h"

#include <cmath>
#include <numeric>

#include "core/rng.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// Weights of n indices: equal, random, mostly zero, or over many orders of magnitude with one that dwarfs the rest.
std::vector<double> weights_of(uint32_t n, int kind) {
    std::vector<double> w;
    for (uint32_t i = 0; i < n; ++i) {
        const Vec4f u = random_floats({n, i, uint32_t(kind), Stream::test}, 0);
        const double values[] = {3.0, double(u.x), u.x < 0.9f ? 0.0 : double(u.y),
                                 i == n / 2 ? 1e12 : std::pow(10.0, -20 * double(u.x))};
        w.push_back(values[kind]);
    }
    return w;
}

}  // namespace

TEST_CASE("alias tables: each index is drawn by exactly its tickets") {
    for (uint32_t n : {1u, 2u, 3u, 7u, 1000u, 2048u, 5000u})
        for (int kind = 0; kind < 4; ++kind) {
            const std::vector<double> weights = weights_of(n, kind);
            const std::vector<uint32_t> tickets = deal_tickets(weights);
            REQUIRE(std::accumulate(tickets.begin(), tickets.end(), uint64_t(0)) == kTickets);
            const std::vector<AliasBucket> table = make_alias_table(tickets);
            REQUIRE(table.size() == n);
            std::vector<uint32_t> drawn(n, 0);
            for (uint32_t t = 0; t < kTickets; ++t) {
                const uint32_t b = bucket_of(t, n);
                ++drawn[t < table[b].threshold ? b : table[b].alias];
            }
            INFO(n << " weights of kind " << kind);
            CHECK(drawn == tickets);
        }
}

TEST_CASE("alias tables: tickets are in proportion, and positive where the weight is") {
    for (uint32_t n : {1u, 3u, 1000u, 5000u, 1u << 20})
        for (int kind = 0; kind < 4; ++kind) {
            const std::vector<double> weights = weights_of(n, kind);
            const std::vector<uint32_t> tickets = deal_tickets(weights);
            const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
            int wrong = 0;
            for (uint32_t i = 0; i < n; ++i) {
                wrong += (tickets[i] > 0) != (weights[i] > 0 || total == 0);
                // Two roundings, the ticket that everyone gets, and the share that those take.
                if (total > 0)
                    wrong += std::fabs(double(tickets[i]) - weights[i] / total * kTickets) > 2 + weights[i] / total * n;
            }
            CHECK(wrong == 0);
        }
    CHECK(deal_tickets({0, 0}) == std::vector<uint32_t>{kTickets / 2, kTickets / 2});
    CHECK(deal_tickets({0, 1e-300, 0}) == std::vector<uint32_t>{0, kTickets, 0});
}

TEST_CASE("tickets are the values of a random float; buckets split them evenly") {
    for (uint32_t bits : {0u, 1u << 8, 12345u << 8, 0xffffffffu}) CHECK(ticket_of(uniform_float(bits)) == bits >> 8);
    for (uint32_t n : {1u, 3u, 2048u, 999983u}) {
        CHECK(bucket_of(0, n) == 0);
        CHECK(bucket_of(kTickets - 1, n) == n - 1);
        for (uint32_t t = 0; t < kTickets; t += 4099) REQUIRE(bucket_of(t, n) == uint64_t(t) * n / kTickets);
    }
}
