// libs: ambilux_session
// timeout: 60
// Ranges of samples, and how they are dealt out by the clock.
#include <algorithm>
#include <set>

#include "session/parallel/ranges.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

FilmMoments pixel() { return {1, 1, 1, std::vector<double>(3), std::vector<double>(3)}; }

struct Simulated {
    double end = 0;             ///< of the last worker
    size_t films = 0;           ///< that were handed over
    std::set<uint64_t> ranges;  ///< that were rendered
    bool aligned = true, once = true;
};

/// Workers that need these seconds for a range.
Simulated simulate(Dealer dealer, const std::vector<double>& per_range) {
    struct Worker {
        double free_at = 0, known = 0;
    };
    std::vector<Worker> workers(per_range.size());
    Simulated s;
    for (;;) {
        const auto next = std::min_element(workers.begin(), workers.end(),
                                           [](const Worker& a, const Worker& b) { return a.free_at < b.free_at; });
        const double seconds = per_range[size_t(next - workers.begin())];
        double rate = 0;
        for (const Worker& w : workers) rate += w.known > 0 ? 1 / w.known : 0;
        const auto node = dealer.next(next->free_at, next->known, rate);
        if (!node) break;
        for (uint64_t range = node->first(); range < node->end(); ++range) s.once &= s.ranges.insert(range).second;
        s.aligned &= node->index << node->level == node->first();
        next->free_at += seconds * double(node->end() - node->first());
        next->known = seconds;
        ++s.films;
    }
    for (const Worker& w : workers) s.end = std::max(s.end, w.free_at);
    return s;
}

}  // namespace

TEST_CASE("ranges cover all samples once; the last may be shorter") {
    const Ranges ranges = {16, 100};
    CHECK(ranges.count() == 7);
    CHECK(ranges.first_sample(6) == 96);
    CHECK(ranges.length(5) == 16);
    CHECK(ranges.length(6) == 4);
    CHECK(Ranges{1000, 0}.count() > 4000000);
}

TEST_CASE("the size of ranges follows from the render alone") {
    CHECK(default_range_size(4096, 1920 * 1080, false) == 32);
    CHECK(default_range_size(4, 1 << 20, false) == 1);
    CHECK(default_range_size(1024, 24 * 16, false) == 342);
    CHECK(default_range_size(1024, 640 * 360, true) == 292);
    CHECK(default_range_size(8192, 1920 * 1080, true) == 256);
    CHECK(default_range_size(10000, 1920 * 1080, true) == 256);
    CHECK(default_range_size(2048, 1920 * 1080, true) == 64);
    CHECK(default_range_size(8, 24 * 16, true) == 8);  // no more than there are
}

TEST_CASE("each range is dealt once, and devices of any speeds end nearly together") {
    for (const std::vector<double>& speeds :
         {std::vector<double>{0.1}, {0.1, 0.1}, {0.01, 0.1, 0.03}, std::vector<double>(8, 0.02), {0.5, 0.5, 0.05}}) {
        const Ranges ranges = {4, 4003};
        const Simulated s = simulate(Dealer(ranges, 0, {}), speeds);
        CHECK(s.ranges.size() == ranges.count());
        CHECK(s.once);
        CHECK(s.aligned);
        double rate = 0;
        for (const double seconds : speeds) rate += 1 / seconds;
        const double slowest = *std::max_element(speeds.begin(), speeds.end());
        CHECK(s.end <= double(ranges.count()) / rate + 1.5 * slowest);
        if (speeds.size() == 8) CHECK(s.films < ranges.count() / 4);  // films of several ranges are handed over as one
    }
}

TEST_CASE("what an earlier part rendered is not dealt again") {
    MergeTree done;
    for (const RangeNode node : {RangeNode{0, 0}, {1, 1}, {3, 1}, {0, 21}}) done.add(node, pixel());
    const Ranges ranges = {1, 50};
    const Simulated s = simulate(Dealer(ranges, 0, done), {0.01, 0.02});
    CHECK(s.once);
    for (uint64_t range = 0; range < 50; ++range) CHECK(s.ranges.contains(range) == !done.has(range));
}

TEST_CASE("a budget in seconds ends within half a range of the slowest device") {
    for (const std::vector<double>& speeds : {std::vector<double>{0.3}, {0.3, 0.05}, {0.01, 0.02, 1.0}}) {
        const Simulated s = simulate(Dealer({8, 0}, 20, {}), speeds);
        const double slowest = *std::max_element(speeds.begin(), speeds.end());
        CHECK(s.end >= 20 - 0.5 * slowest);
        CHECK(s.end <= 20 + 0.5 * slowest);
    }
    CHECK(!Dealer({8, 0}, 20, {}).next(20.0, 0, 0));
    CHECK(!Dealer({8, 0}, 20, {}).next(19.9, 1, 1));
}

TEST_CASE("a rank gets as many times the ranges as it has devices, and no more than its share of what is left") {
    const Ranges ranges = {1, 1024};
    const auto length = [&](double rate, size_t devices) {
        const RangeNode node = Dealer(ranges, 0, {}).next(0, 0.5, rate, devices).value();
        return node.end() - node.first();
    };
    CHECK(length(16, 1) == 4);  // 2 s of one device
    CHECK(length(16, 8) == 32);
    CHECK(length(1024, 8) == 8);                                           // half of the second that all need for it
    const auto timed = Dealer({1, 0}, 10, {}).next(9, 0.5, 0, 4).value();  // 1 s is left
    CHECK(timed.end() - timed.first() == 8);
}

TEST_CASE("where films cost much, nodes take longer: films take half of the time of whoever adds them up, at most") {
    CHECK(Dealer::node_seconds(1, 1, 0) == 2);
    CHECK(Dealer::node_seconds(8, 1, 0.125) == 2);
    CHECK(Dealer::node_seconds(8, 1, 0.5) == 8);
    CHECK(Dealer::node_seconds(8, 2, 0.5) == 4);  // of two nodes in a block one film comes
    CHECK(Dealer::node_seconds(8, 4, 0.5) == 2);
    const auto length = [](double node_seconds) {
        Dealer dealer({1, 1024}, 0, {});
        dealer.set_node_seconds(node_seconds);
        const RangeNode node = dealer.next(0, 0.5, 16).value();
        return node.end() - node.first();
    };
    CHECK(length(2) == 4);
    CHECK(length(8) == 16);
}
