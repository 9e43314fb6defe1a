// Runs the stages of one wave on the calling thread, over queues that belong to it alone (integrators/integrator.h says
// what an executor has).
#pragma once

#include <algorithm>
#include <chrono>
#include <utility>

#include "backends/cpu/primitives.h"
#include "queues/order.h"
#include "queues/overflow.h"
#include "stages/fused_clock.h"
#include "stages/order_keys.h"
#include "stages/ray_packets.h"
#include "stages/stage.h"

namespace ambilux {

/// No stage is computed in lanes; backends/cpu/plain_lanes.h has some that are.
template <class Stage>
struct NoLanes {
    static constexpr bool kHas = false;
};

/// `LanesOf`: of a stage, whether it is computed in lanes, and by what.
template <template <class> class LanesOf>
class CpuExecutorWith {
public:
    static constexpr bool kHost = true;

    explicit CpuExecutorWith(WaveState* state) : state_(state) {}
    CpuExecutorWith(WaveState* state, const SceneView& scene, const OrderMemory& order)
        : state_(state), scene_(&scene), order_(order) {}

    template <class Stage>
    void run_slots(const Stage& stage, uint32_t slots, uint32_t samples = 0) {
        const uint32_t n = slots * (samples ? samples : state_->samples);
        const Start start;
        for (uint32_t i = 0; i < n; ++i) stage(i);
        record(stage, n, start);
    }
    template <class Stage>
    void run_paths(const Stage& stage, uint32_t slots) {
        const uint32_t n = slots * state_->samples;
        const Start start;
        stage.run(0, n, 1);
        record(stage, n, start);
    }
    template <class Stage>
    void run(const Stage& stage) {
        if constexpr (LanesOf<Stage>::kHas) {
            typename LanesOf<Stage>::Lanes lanes(stage);
            run_in_order<MaterialOrder>(stage, [&](uint32_t i) { lanes.add(i); }, [&] { lanes.run(); });
        } else {
            run_in_order<MaterialOrder>(stage, stage, [] {});
        }
    }
    template <class Stage>
    void trace(const Stage& stage) {
        if constexpr (requires { Stage::kAnyHit; })
            trace_packets<MortonOrder>(stage, false);
        else
            run_in_order<MortonOrder>(stage, stage, [] {});
    }
    /// What is left of a queue of Gathered (stages/arrival.h), in its order: a path may have several rays there, and
    /// what they bring is added one after the other.
    template <class Stage>
    void trace_gathered(const Stage& stage) {
        trace_packets<void>(stage, false);
    }
    template <class Stage>
    void extend(const Stage& stage) {
        if (!stage.hits.flags) stage.hits.counter->count = stage.rays.counter->size();
        trace(stage);
    }
    /// Rays that are in order as they are.
    template <class Stage>
    void extend_coherent(const Stage& stage) {
        if (!stage.hits.flags) stage.hits.counter->count = stage.rays.counter->size();
        trace_packets<void>(stage, true);
    }
    template <class Item, class Body>
    void repeat_while(const Queue<Item>& queue, Body body) {
        while (queue.counter->count > 0) body();
    }
    template <class A, class B>
    void fail_on_overflow(const Queue<A>& a, const Queue<B>& b) {
        fail_wave_on_overflow(*state_, *a.counter, *b.counter);
    }
    template <class Item>
    void clear(const Queue<Item>& queue) {
        queue.counter->finish();
    }
    static void store(uint32_t* place, uint32_t value) { *place = value; }
    /// Has all waves' queue hold what is in that of this wave (stage.items()): stage(i, place) puts item i at `place`.
    /// If there is no room, the wave fails, and the queues `others` are emptied as well.
    template <class Stage, class... Item>
    void append(const Stage& stage, const Queue<Item>&... others) {
        const Start start;
        reserve_appended(*state_, *stage.items().counter, *stage.target());
        if (state_->failed) (others.counter->finish(), ...);
        const uint32_t n = stage.items().counter->size();
        for (uint32_t i = 0; i < n; ++i) stage(i, state_->appended + i);
        record(stage, n, start);
    }
    /// Over items that stay.
    template <class Stage, class Item>
    void for_each(const Stage& stage, const Queue<Item>& queue) {
        for_each(stage, queue.counter->size());
    }
    template <class Stage>
    void for_each(const Stage& stage, uint32_t n) {
        run_slots(stage, n, 1);
    }
    /// Of as many pairs as `queue` has items, by the lowest `bits` bits.
    template <class Key, class Item>
    void sort_pairs(const SortMemory<Key>& m, const Queue<Item>& queue, uint32_t bits, StageRecord* record) {
        const Start start;
        sort_pairs_alone(m, queue.counter->size(), bits);
        record->nanoseconds += elapsed(start);
    }
    void set_depth(uint32_t depth) { state_->depth = depth; }
    void next_depth(uint32_t depths) { state_->depth += depths; }

private:
    static constexpr uint32_t kAhead = 8;  ///< items by which a stage's prefetch(i) is ahead
    using Clock = std::chrono::steady_clock;
    /// Of a launch. Stages that run inside of it have clocks of their own.
    struct Start {
        int64_t inside = FusedTime::inside();
        Clock::time_point time = Clock::now();
    };

    template <class Order, class Stage>
    void trace_packets(const Stage& stage, bool coherent) {
        RayPackets<Stage> packets(stage, coherent);
        run_in_order<Order>(stage, [&](uint32_t i) { packets.add(i); }, [&] { packets.trace(); });
    }
    /// Calls each(i) for the items of `stage`, and end() after them. One place where a stage is called: it is inlined
    /// there as a whole.
    template <class Order, class Stage, class Each, class End>
    void run_in_order(const Stage& stage, const Each& each, const End& end) {
        const auto& queue = stage.items();
        const uint32_t items = queue.counter->size();
        if (items == 0) return;
        const Start start;
        const uint32_t* list = make_list<Order>(queue);
        const bool gaps = queue.flags && !list;
        const uint32_t n = gaps ? queue.capacity() : items;
        for (uint32_t i = 0; i < n; ++i) {
            if constexpr (requires { stage.prefetch(i); })
                if (!list && i + kAhead < n) stage.prefetch(i + kAhead);
            if (gaps && !claim(queue, i)) continue;
            each(list ? list[i] : i);
        }
        end();
        queue.counter->finish();
        record(stage, items, start);
    }
    /// The slots of all items, if they do not lie one after the other or not in the order in which they are wanted;
    /// null: as they lie.
    template <class Order, class Item>
    const uint32_t* make_list(const Queue<Item>& queue) const {
        bool sorted = false;
        if constexpr (Ordered<Order, Item>) sorted = order_.policy.ordering == Order::kOrdering;
        if (!sorted && !(queue.flags && order_.policy.compaction == Compaction::select)) return nullptr;
        uint32_t n = 0;
        uint32_t *list = order_.list[0], *keys = order_.keys[0];
        for (uint32_t i = 0, end = queue.flags ? queue.capacity() : queue.counter->size(); i < end; ++i)
            if (!queue.flags || claim(queue, i)) list[n++] = i;
        if constexpr (Ordered<Order, Item>) {
            if (sorted) {
                for (uint32_t i = 0; i < n; ++i) keys[list[i]] = order_key<Order>(*scene_, queue, list[i]);
                std::sort(list, list + n,
                          [&](uint32_t a, uint32_t b) { return keys[a] != keys[b] ? keys[a] < keys[b] : a < b; });
            }
        }
        return list;
    }
    /// False if there is no item. Its slot is empty from now on.
    template <class Item>
    static bool claim(const Queue<Item>& queue, uint32_t slot) {
        return std::exchange(queue.flags[slot], uint8_t(0));
    }
    template <class Stage>
    void record(const Stage& stage, uint32_t items, const Start& start) {
        stage.record->add(items, state_->depth, elapsed(start));
    }
    static uint64_t elapsed(const Start& start) {
        const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start.time).count();
        return uint64_t(ns - (FusedTime::inside() - start.inside));
    }

    WaveState* state_;
    const SceneView* scene_ = nullptr;
    OrderMemory order_{};
};
using CpuExecutor = CpuExecutorWith<NoLanes>;

}  // namespace ambilux
