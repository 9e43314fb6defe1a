// libs: ambilux_transport ambilux_scene ambilux_core
// How stages gather rays on a host: in order, all of them, at the ends of queues too.
#include <chrono>
#include <cmath>
#include <vector>

#include "queues/layout.h"
#include "stages/arrival.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// What was asked for and in which portions; rays whose tmax is odd are blocked.
struct Log {
    std::vector<uint32_t> portions;
    std::vector<uint32_t> finished, blocked;
};

struct FakeTracer {
    Log* log;

    template <Features F>
    void occluded(const SceneView&, const Ray* rays, uint32_t count, bool, bool* blocked) const {
        if (count > 0) log->portions.push_back(count);
        for (uint32_t k = 0; k < count; ++k) blocked[k] = uint32_t(rays[k].tmax) % 2;
    }
};

struct Item {
    uint32_t number;
    uint32_t pad[3];
};

/// Every fifth ray is invalid.
struct FakeStage {
    static constexpr Features kFeatures = {};
    static constexpr bool kAnyHit = true;
    using Kept = uint32_t;

    SceneView scene{};
    FakeTracer tracer;
    Queue<Item> queue;
    StageRecord* record;

    const Queue<Item>& items() const { return queue; }
    bool fetch(uint32_t i, Ray& ray, Kept& kept) const {
        kept = queue.load(i).number;
        ray = {{0, 0, 0}, float(kept), {0, 0, 1}, 0};
        return kept % 5 != 4;
    }
    void finish(uint32_t, Kept kept, bool blocked) const {
        (blocked ? tracer.log->blocked : tracer.log->finished).push_back(kept);
    }
};

struct Fixture {
    Log log;
    StageRecord record{};
    QueueCounter counter{};
    std::vector<Lane> lanes = std::vector<Lane>(64);
    FakeStage stage;

    explicit Fixture(uint32_t capacity) {
        counter.capacity = capacity;
        stage.tracer = {&log};
        stage.queue.items = {lanes.data(), capacity};
        stage.queue.counter = &counter;
        stage.record = &record;
    }
    void check_all(uint32_t n) const {
        std::vector<uint32_t> even, odd;
        for (uint32_t i = 0; i < n; ++i)
            if (i % 5 != 4) (i % 2 ? odd : even).push_back(i);
        CHECK(log.finished == even);
        CHECK(log.blocked == odd);
    }
};

}  // namespace

TEST_CASE("Packets hold all valid rays of a queue of any length, in its order") {
    for (const uint32_t n : {0u, 1u, 15u, 16u, 17u, 20u, 21u, 40u, 64u}) {
        INFO(n << " items");
        Fixture f(64);
        for (uint32_t i = 0; i < n; ++i) f.stage.queue.push({i, {}});
        RayPackets<FakeStage> packets(f.stage);
        for (uint32_t i = 0; i < n; ++i) packets.add(i);
        packets.trace();
        f.check_all(n);
        for (size_t k = 0; k + 1 < f.log.portions.size(); ++k) CHECK(f.log.portions[k] == kMostPacketRays);
    }
}

TEST_CASE("A gathered queue is traced whenever it is full, and keeps its order") {
    constexpr uint32_t kCapacity = 7, kItems = 40;
    Fixture f(kCapacity);
    WaveState state{};
    state.depth = 3;
    const Gathered<FakeStage> gathered = {f.stage, &state, kCapacity};
    for (uint32_t i = 0; i < kItems; ++i) {
        gathered.push(Item{i, {}});
        CHECK(f.counter.count < kCapacity);
    }
    CHECK(f.counter.count == kItems % kCapacity);
    CHECK(f.counter.overflow == 0);
    CHECK(f.record.items == kItems - kItems % kCapacity);
    CHECK(f.record.items_by_depth[3] == f.record.items);
    CHECK(f.record.launches == 0);
    RayPackets<FakeStage> rest(f.stage);
    for (uint32_t i = 0; i < f.counter.size(); ++i) rest.add(i);
    rest.trace();
    f.check_all(kItems);
}

TEST_CASE("A gathered queue of one traces each ray at once") {
    Fixture f(4);
    WaveState state{};
    const Gathered<FakeStage> gathered = {f.stage, &state, 1};
    for (uint32_t i = 0; i < 9; ++i) {
        gathered.push(Item{i, {}});
        CHECK(f.counter.count == 0);
    }
    f.check_all(9);
}

namespace {

void busy(int microseconds) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(microseconds);
    while (std::chrono::steady_clock::now() < end) {}
}

}  // namespace

TEST_CASE("A stage inside of another has the time that is its own, and the other does not") {
    StageRecord outer{}, inner{};
    const int64_t before = FusedTime::inside();
    {
        const FusedClock clock(&outer);
        busy(2000);
        {
            const FusedClock other(&inner);
            busy(4000);
        }
        busy(2000);
    }
    // But for the time of looking at the clock.
    CHECK(double(inner.nanoseconds) >= 3.9e6);
    CHECK(double(outer.nanoseconds) >= 3.9e6);
    // Together they are all of the time, however long a busy machine made it.
    CHECK(FusedTime::inside() - before == int64_t(inner.nanoseconds + outer.nanoseconds));
    CHECK(outer.launches == 0);
}

TEST_CASE("Looks at the clock are spread evenly over calls that alternate") {
    constexpr int kCalls = 1 << 20;
    int looks[4] = {};
    for (int i = 0; i < kCalls; ++i) looks[i % 4] += FusedTime::looks();
    const double expected = double(kCalls) / 4 / double(FusedTime::kOnceIn);
    for (int n : looks) CHECK(std::abs(n - expected) < 5 * std::sqrt(expected));
}

TEST_CASE("The time of a sampled stage is counted as often as it was not looked at") {
    StageRecord sampled{}, whole{};
    {
        const FusedClock all(&whole);
        for (int i = 0; i < 4000; ++i) {
            const FusedClock clock(&sampled, true);
            busy(10);
        }
    }
    // 40 ms of 250 looks, standard error 6 %; the rest is that of the stage around it, whatever was estimated.
    CHECK(double(sampled.nanoseconds) > 0.75 * 40e6);
    CHECK(double(sampled.nanoseconds + whole.nanoseconds) >= 39e6);
}
