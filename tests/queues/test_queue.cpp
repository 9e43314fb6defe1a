// libs: ambilux_stages ambilux_queues
// Queues on the host: storage, counting, layout, queues by path, the order in which stages go through them.
#include <algorithm>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "backends/cpu/executor.h"
#include "queues/order.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

struct Item {
    uint32_t word[12];
};

Item numbered(uint32_t i) {
    Item item;
    for (uint32_t k = 0; k < 12; ++k) item.word[k] = i * 12 + k;
    return item;
}

/// A queue of the given capacity with its memory.
struct OwnedQueue {
    std::vector<Lane> memory;
    QueueCounter counter{};
    Queue<Item> queue;

    explicit OwnedQueue(uint32_t capacity) : memory(size_t(capacity) * LaneArray<Item>::kLanes + 1) {
        counter.capacity = capacity;
        queue = {{memory.data(), capacity}, &counter};
    }
};

/// Items of which the first ones are the front of the second.
struct Front {
    static constexpr uint32_t kPairedLanes = 2;
    Lane lane[3];
};

struct Whole {
    static constexpr uint32_t kPairedLanes = 2;
    Lane lane[4];
};

}  // namespace

TEST_CASE("queue: a lane that is known is neither stored nor loaded, and the last lane is read alone") {
    std::vector<Lane> memory(2 * LaneArray<Whole>::kLanes + 1, Lane{{9, 9, 9, 9}});
    QueueCounter counter{};
    const Queue<Whole> queue = {{memory.data(), 2}, &counter};
    const Whole item = {{{{1, 2, 3, 4}}, {{5, 6, 7, 8}}, {{10, 11, 12, 13}}, {{14, 15, 16, 17}}}};
    const auto same = [](const Lane& a, const Lane& b) { return std::equal(a.word, a.word + 4, b.word); };
    for (uint32_t known = 0; known <= LaneArray<Whole>::kLanes; ++known) {
        std::fill(memory.begin(), memory.end(), Lane{{9, 9, 9, 9}});
        queue.items.store_but(1, known, item);
        const Whole stored = queue.load(1), untouched = queue.load(0);
        queue.store(1, item);
        const Whole loaded = queue.items.load_but(1, known, {{20, 21, 22, 23}});
        for (uint32_t k = 0; k < LaneArray<Whole>::kLanes; ++k) {
            CHECK(same(stored.lane[k], k == known ? Lane{{9, 9, 9, 9}} : item.lane[k]));
            CHECK(same(untouched.lane[k], {{9, 9, 9, 9}}));
            CHECK(same(loaded.lane[k], k == known ? Lane{{20, 21, 22, 23}} : item.lane[k]));
        }
        CHECK(same(queue.items.load_last<Lane>(1), item.lane[3]));
    }
}

TEST_CASE("queue: what is pushed is loaded, for any size") {
    for (const uint32_t n : {0u, 1u, 31u, 32u, 33u, 1000u, (1u << 20) + 1}) {
        OwnedQueue q(n);
        for (uint32_t i = 0; i < n; ++i) q.queue.push(numbered(i));
        REQUIRE(q.counter.size() == n);
        uint64_t wrong = 0;
        for (uint32_t i = 0; i < n; ++i) {
            const Item item = q.queue.load(i);
            for (uint32_t k = 0; k < 12; ++k) wrong += item.word[k] != i * 12 + k;
        }
        CHECK(wrong == 0);
    }
}

TEST_CASE("queue: lanes of an item lie a capacity apart, so that neighbours are adjacent in memory") {
    OwnedQueue q(7);
    for (uint32_t i = 0; i < 7; ++i) q.queue.push(numbered(i));
    for (uint32_t i = 0; i < 7; ++i)
        for (uint32_t lane = 0; lane < 3; ++lane) CHECK(q.memory[lane * 7 + i].word[0] == i * 12 + lane * 4);
}

TEST_CASE("queue: the first lanes of items that ask for it lie two by two, and fronts lie where their items do") {
    const auto lay = [](Layout& layout) {
        const Queue<Whole> whole = layout.queue<Whole>("whole", 5);
        return std::pair(whole, layout.front<Front>("front", whole));
    };
    Layout plan;
    lay(plan);
    std::vector<Lane> memory(plan.bytes() / sizeof(Lane));
    Layout layout(plan, memory.data());
    const auto [whole, front] = lay(layout);
    std::set<const Lane*> places;
    for (uint32_t i = 0; i < 5; ++i) {
        Front item{};
        for (uint32_t k = 0; k < 3; ++k) item.lane[k].word[0] = 10 * i + k;
        CHECK(front.push(item) == i);
        Lane last{};
        last.word[0] = 10 * i + 3;
        whole.complete(i, last);
    }
    for (uint32_t i = 0; i < 5; ++i) {
        const Whole item = whole.load(i);
        for (uint32_t k = 0; k < 4; ++k) CHECK(item.lane[k].word[0] == 10 * i + k);
        for (uint32_t k = 0; k < 4; ++k) places.insert(&whole.items.base[whole.items.place(i, k)]);
        CHECK(whole.items.place(i, 1) == 2 * i + 1);
        CHECK(whole.items.place(i, 2) == 10 + i);
    }
    CHECK(places.size() == 20);
    CHECK(*places.rbegin() - *places.begin() == 19);
}

TEST_CASE("G3: a push past the capacity is counted, and touches nothing") {
    OwnedQueue q(5);
    q.memory.back().word[0] = 0xabcdu;
    for (uint32_t i = 0; i < 9; ++i) q.queue.push(numbered(i));
    CHECK(q.counter.size() == 5);
    CHECK(q.memory.back().word[0] == 0xabcdu);
    for (uint32_t i = 0; i < 5; ++i) CHECK(q.queue.load(i).word[11] == i * 12 + 11);
    q.counter.finish();
    CHECK(q.counter.overflow == 4);
    CHECK(q.counter.peak == 9);
    CHECK(q.counter.size() == 0);
    q.queue.push(numbered(1));
    q.counter.finish();
    CHECK(q.counter.overflow == 4);
    CHECK(q.counter.peak == 9);
}

TEST_CASE("G8: a layout without memory tells the bytes that one with memory uses") {
    struct Places {
        std::vector<const void*> values, records;
    };
    const auto lay = [](Layout& layout) {
        Places places;
        places.values.push_back(layout.allocate<uint32_t>(3));
        places.records.push_back(layout.record("a"));
        for (const uint32_t n : {0u, 1u, 100u, 4097u}) places.values.push_back(layout.queue<Item>("q", n).items.base);
        places.records.push_back(layout.record("b"));
        places.records.push_back(layout.record("a"));
        places.values.push_back(layout.allocate<double>(7));
        return places;
    };
    Layout dry;
    for (const auto& nothing : {lay(dry)}) {
        for (const void* p : nothing.values) CHECK(p == nullptr);
        for (const void* p : nothing.records) CHECK(p == nullptr);
    }
    std::vector<Lane> memory(dry.bytes() / sizeof(Lane) + 16);
    void* start = memory.data();
    size_t space = memory.size() * sizeof(Lane);
    start = std::align(256, dry.bytes(), start, space);
    Layout real(dry, start);
    const Places places = lay(real);
    CHECK(real.bytes() == dry.bytes());
    CHECK(real.queue_names().size() == 4);
    CHECK(real.queue_capacities() == std::vector<uint32_t>{0, 1, 100, 4097});
    for (const void* p : places.values) CHECK(reinterpret_cast<uintptr_t>(p) % 256 == 0);
    // Only the empty queue may share its place.
    CHECK(std::set<const void*>(places.values.begin(), places.values.end()).size() == places.values.size() - 1);

    // Counters and records come first, each in the order in which they were asked for; a name has one record.
    CHECK(real.record_names() == std::vector<std::string>{"a", "b"});
    CHECK(real.record_names() == dry.record_names());
    CHECK(static_cast<void*>(real.counters()) == start);
    CHECK(places.records == std::vector<const void*>{real.records(), real.records() + 1, real.records()});
    CHECK(static_cast<const void*>(real.counters() + 4) <= static_cast<const void*>(real.records()));
    for (const void* p : places.values) {
        CHECK(p >= static_cast<const void*>(real.records() + 2));
        CHECK(p < static_cast<const std::byte*>(start) + dry.bytes());
    }
    const std::vector<QueueCounter> counters = real.first_counters();
    REQUIRE(counters.size() == 4);
    for (size_t q = 0; q < 4; ++q) {
        CHECK(counters[q].capacity == real.queue_capacities()[q]);
        CHECK(counters[q].count + counters[q].peak + counters[q].overflow + counters[q].next + counters[q].holes == 0);
    }
}

TEST_CASE("G8: a layout without memory tells the bytes of every kind of queue, by path or appended to") {
    for (const bool by_path : {false, true})
        for (const uint32_t n : {0u, 1u, 257u, 5000u}) {
            INFO(n << " slots, by path " << by_path);
            const auto lay = [&](Layout& layout) {
                std::vector<std::pair<const void*, uint64_t>> places;
                const auto add = [&](const void* start, uint64_t bytes) { places.emplace_back(start, bytes); };
                const Queue<Whole> whole = layout.queue<Whole>("whole", n, by_path);
                const Queue<Front> front = layout.front<Front>("front", whole);
                const Queue<Whole> other = layout.alternate(whole);
                add(whole.items.base, n * sizeof(Whole));
                add(other.items.base, n * sizeof(Whole));
                add(whole.flags, by_path ? n : 0);
                add(front.flags, by_path ? n : 0);
                add(layout.array<Whole>(n, 3).base, 3 * n * sizeof(Lane));
                add(layout.queue<Item>("last", n, by_path).flags, by_path ? n : 0);
                CHECK(whole.capacity() == n);
                CHECK(front.capacity() == n);
                CHECK(other.capacity() == n);
                return places;
            };
            Layout plan;
            lay(plan);
            std::vector<Lane> memory(plan.bytes() / sizeof(Lane) + n + 16);
            void* start = memory.data();
            size_t room = memory.size() * sizeof(Lane);
            Layout layout(plan, std::align(256, plan.bytes(), start, room));
            auto places = lay(layout);
            CHECK(layout.bytes() == plan.bytes());
            CHECK(layout.queue_capacities() == std::vector<uint32_t>(3, n));
            // None lies in another, and all in what was planned.
            std::erase_if(places, [](const auto& p) { return p.second == 0; });
            std::sort(places.begin(), places.end());
            for (size_t k = 0; k < places.size(); ++k) {
                const std::byte* const end = static_cast<const std::byte*>(places[k].first) + places[k].second;
                CHECK(places[k].first != nullptr);
                CHECK(end <= (k + 1 < places.size() ? places[k + 1].first
                                                    : static_cast<const std::byte*>(start) + plan.bytes()));
            }
        }
}

TEST_CASE("queue by path: an item lies where its path says; a second one for the same path is counted as lost") {
    std::vector<Lane> memory(5);
    std::vector<uint8_t> flags(5);
    QueueCounter counter{};
    counter.capacity = 5;
    const Queue<Contribution> queue = {{memory.data(), 5}, &counter, flags.data()};
    for (const uint32_t path : {3u, 0u, 4u}) CHECK(queue.push({{float(path), 0.0f, 0.0f}, path}) == path);
    CHECK(flags == std::vector<uint8_t>{1, 0, 0, 1, 1});
    for (const uint32_t path : {0u, 3u, 4u}) CHECK(queue.load(path).value.x == float(path));
    CHECK(counter.size() == 3);
    CHECK(counter.overflow == 0);
    queue.push({{}, 3});
    CHECK(counter.overflow == 1);
    queue.push({{}, 5});
    CHECK(counter.overflow == 2);
    CHECK(flags == std::vector<uint8_t>{1, 0, 0, 1, 1});
    // The path of a hit is that of its ray.
    HitItem<SubpathRay<BidirectionalMis>> hit{};
    hit.ray.path = 7;
    CHECK(path_of(hit) == 7);
}

namespace {

/// Notes what it is called with, and puts an item of every second path into another queue.
struct Note {
    static constexpr const char* kName = "note";

    Queue<PathHit> in, out;
    std::vector<uint32_t>* paths;
    StageRecord* record;

    const Queue<PathHit>& items() const { return in; }
    void operator()(uint32_t i) const {
        const PathHit item = in.load(i);
        paths->push_back(item.ray.path);
        if (item.ray.path % 2 == 0) out.push(item);
    }
};

}  // namespace

TEST_CASE("an executor goes through all items once, in the order that is asked for, for any size") {
    for (const uint32_t n : {0u, 1u, 31u, 32u, 33u, 1000u}) {
        for (const Compaction compaction : {Compaction::atomic, Compaction::select, Compaction::none}) {
            for (const Ordering ordering : {Ordering::none, Ordering::material, Ordering::morton}) {
                INFO(n << " slots, compaction " << compaction_name(compaction) << ", ordering "
                       << ordering_name(ordering));
                const QueuePolicy policy = {compaction, ordering};
                Queue<PathHit> queues[2];
                OrderMemory order;
                const auto lay = [&](Layout& layout) {
                    for (Queue<PathHit>& q : queues) q = layout.queue<PathHit>("hits", n, policy.fixed_places());
                    order = lay_out_order(layout, policy, n);
                    layout.record(Note::kName);
                };
                Layout sizes;
                lay(sizes);
                std::vector<Lane> memory(sizes.bytes() / sizeof(Lane) + 1);
                Layout layout(sizes, memory.data());
                lay(layout);
                CHECK(layout.bytes() == sizes.bytes());
                const std::vector<QueueCounter> first = layout.first_counters();
                std::copy(first.begin(), first.end(), layout.counters());
                const QueueCounter* const counters = layout.counters();
                StageRecord* const record = layout.record(Note::kName);

                // Three materials in turn, and one hit in seven of nothing.
                const uint16_t materials[3] = {2, 0, 1};
                SceneView scene{};
                scene.sort_keys = materials;
                scene.triangle_count = 3;
                scene.material_count = 3;
                // Items that are appended have keys that are kept for half of the sizes, others than those that would
                // be looked up.
                const bool kept = n % 2 == 0 && compaction == Compaction::atomic;
                const auto key = [&](uint32_t path) {
                    const uint32_t material = path % 7 == 0 ? 3 : materials[path % 3];
                    return uint16_t(kept ? 3 - material : material);
                };
                std::vector<uint16_t> keys(n);
                if (kept) queues[0].keys = keys.data();

                WaveState state{};
                CpuExecutor executor(&state, scene, order);
                std::vector<uint32_t> expected, paths;
                for (uint32_t path = 0; path < n; ++path) {
                    if (path % 5 == 1) continue;
                    PathHit item{};
                    item.ray.path = path;
                    item.prim = path % 7 == 0 ? kNone : path % 3;
                    keys[queues[0].push(item)] = key(path);
                    expected.push_back(path);
                }
                const auto by_material = [&](std::vector<uint32_t> list) {
                    if (ordering == Ordering::material)
                        std::stable_sort(list.begin(), list.end(),
                                         [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
                    return list;
                };
                executor.run(Note{queues[0], queues[1], &paths, record});
                CHECK(paths == by_material(expected));
                CHECK(counters[0].count == 0);
                CHECK(counters[0].peak == expected.size());
                // What was pushed while the first queue was gone through.
                std::erase_if(expected, [](uint32_t path) { return path % 2 == 1; });
                paths.clear();
                executor.run(Note{queues[1], queues[0], &paths, record});
                std::vector<uint32_t> sorted = paths;
                std::sort(sorted.begin(), sorted.end());
                CHECK(sorted == expected);
                if (compaction != Compaction::atomic || ordering != Ordering::material)
                    CHECK(paths == by_material(expected));
                CHECK(record->items == counters[0].count + counters[0].peak);
                for (int q = 0; q < 2; ++q) CHECK(counters[q].overflow == 0);
            }
        }
    }
}

TEST_CASE("keys of rays: octant first, then the Z curve of a grid over the scene; never the key of an empty place") {
    SceneView scene{};
    scene.bounds_center = {1.0f, 2.0f, 3.0f};
    scene.bounds_radius = 4.0f;
    const auto key = [&](Vec3f o, Vec3f d) {
        PathRay ray{};
        ray.origin = o;
        ray.direction = d;
        return MortonOrder::key(scene, ray);
    };
    const Vec3f up = {1.0f, 1.0f, 1.0f};
    CHECK(key({-3.0f, -2.0f, -1.0f}, up) == 0);
    CHECK(key({5.0f, 6.0f, 7.0f}, -up) == 0xfffffe);
    CHECK(key({4.99f, 5.99f, 6.99f}, up) == 0x1fffff);
    const float cell = 8.0f / 128.0f;
    // One cell along x, y, z is bit 0, 1, 2; two cells are bit 3 and so on up to 64 cells.
    for (uint32_t bit = 0; bit < 7; ++bit) {
        const float far = cell * (float(1u << bit) + 0.5f), near = 0.5f * cell;
        CHECK(key(Vec3f{-3.0f, -2.0f, -1.0f} + Vec3f{far, near, near}, up) == 1u << 3 * bit);
        CHECK(key(Vec3f{-3.0f, -2.0f, -1.0f} + Vec3f{near, far, near}, up) == 2u << 3 * bit);
        CHECK(key(Vec3f{-3.0f, -2.0f, -1.0f} + Vec3f{near, near, far}, up) == 4u << 3 * bit);
    }
    CHECK(key({-3.0f, -2.0f, -1.0f}, {-1.0f, 1.0f, -1.0f}) == 5u << 21);
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    for (const float x : {nan, inf, -inf}) CHECK(key({x, x, x}, {x, x, x}) < 0xffffffu);
    scene.bounds_radius = 0.0f;
    CHECK(key({1.0f, 2.0f, 3.0f}, up) < 0xffffffu);
    for (const uint32_t materials : {0u, 1u, 2u, 3u, 254u, 255u, 256u, 0xfffdu, 0xfffeu, 0xffffu, 0x10000u, 1u << 20}) {
        scene.material_count = materials;
        const uint32_t nothing = MaterialOrder::of(scene, kNone);
        CHECK(nothing == std::min(materials, 0xfffeu));
        CHECK(nothing < (1u << MaterialOrder::bits(scene)) - 1);
        CHECK(MaterialOrder::bits(scene) <= 16);
    }
}
