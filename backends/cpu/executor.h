// Runs the stages of one wave on the calling thread, over queues that belong to it alone.
#pragma once

#include <algorithm>
#include <chrono>

#include "queues/order.h"
#include "queues/queue.h"
#include "queues/wave.h"
#include "stages/order_keys.h"
#include "stages/settle.h"
#include "stages/stage.h"

namespace ambilux {

class CpuExecutor {
public:
    CpuExecutor(WaveState* state, StageRecord* records) : state_(state), records_(records) {}
    CpuExecutor(WaveState* state, StageRecord* records, const SceneView& scene, const OrderMemory& order)
        : state_(state), records_(records), scene_(&scene), order_(order) {}

    template <class Stage>
    void run_slots(StageId id, const Stage& stage, uint32_t slots, uint32_t samples = 0) {
        const uint32_t n = slots * (samples ? samples : state_->samples);
        const auto start = Clock::now();
        for (uint32_t i = 0; i < n; ++i) stage(i);
        record(id, n, start);
    }
    /// A stage that takes its slots by itself.
    template <class Stage>
    void run_paths(StageId id, const Stage& stage, uint32_t slots) {
        const uint32_t n = slots * state_->samples;
        const auto start = Clock::now();
        stage.run(0, n, 1);
        record(id, n, start);
    }
    template <class Stage, class Item>
    void run(StageId id, const Stage& stage, const Queue<Item>& queue) {
        run_in_order<MaterialOrder>(id, stage, queue);
    }
    template <class Stage, class Item>
    void trace(StageId id, const Stage& stage, const Queue<Item>& queue) {
        run_in_order<MortonOrder>(id, stage, queue);
    }
    template <class Stage, class Item, class Out>
    void extend(StageId id, const Stage& stage, const Queue<Item>& rays, const Queue<Out>& hits) {
        if (!hits.flags) hits.counter->count = rays.counter->size();
        trace(id, stage, rays);
    }
    /// Rays that are in order as they are.
    template <class Stage, class Item, class Out>
    void extend_coherent(StageId id, const Stage& stage, const Queue<Item>& rays, const Queue<Out>& hits) {
        if (!hits.flags) hits.counter->count = rays.counter->size();
        run_in_order<void>(id, stage, rays);
    }
    template <class Item, class Body>
    void repeat_while(const Queue<Item>& queue, Body body) {
        while (queue.counter->count > 0) body();
    }
    template <class A, class B>
    void settle(const A& a, const B& b) {
        ambilux::settle(*state_, *a.counter, *b.counter);
    }
    template <class Item>
    void clear(const Queue<Item>& queue) {
        queue.counter->finish();
    }
    void set_depth(uint32_t depth) { state_->depth = depth; }
    void next_depth(uint32_t depths = 1) { state_->depth += depths; }

private:
    using Clock = std::chrono::steady_clock;
    static constexpr uint32_t kPrefetchDistance = 8;  ///< items; further or nearer makes no difference between 4 and 16

    /// One place where the stage is called: compilers contract sums of products differently in every copy of a stage,
    /// and images should not depend on the order of queues.
    template <class Order, class Stage, class Item>
    void run_in_order(StageId id, const Stage& stage, const Queue<Item>& queue) {
        const uint32_t items = queue.counter->size();
        if (items == 0) return;
        const auto start = Clock::now();
        const uint32_t* list = make_list<Order>(queue);
        const bool gaps = queue.flags && !list;
        const uint32_t n = gaps ? queue.capacity : items;
        for (uint32_t i = 0; i < n; ++i) {
            if constexpr (requires { stage.far_memory(i); }) {
                if (!queue.flags && !list && i + kPrefetchDistance < n)
                    __builtin_prefetch(stage.far_memory(i + kPrefetchDistance));
            }
            if (gaps && !take(queue, i)) continue;
            stage(list ? list[i] : i);
        }
        queue.counter->finish();
        record(id, items, start);
    }
    /// The places of all items, if they do not lie one after the other or not in the order in which they are wanted;
    /// null: as they lie.
    template <class Order, class Item>
    const uint32_t* make_list(const Queue<Item>& queue) const {
        bool sorted = false;
        if constexpr (Ordered<Order, Item>) sorted = order_.policy.ordering == Order::kOrdering;
        if (!sorted && !(queue.flags && order_.policy.compaction == Compaction::select)) return nullptr;
        uint32_t n = 0;
        uint32_t *list = order_.list[0], *keys = order_.keys[0];
        for (uint32_t i = 0, end = queue.flags ? queue.capacity : queue.counter->size(); i < end; ++i)
            if (!queue.flags || take(queue, i)) list[n++] = i;
        if constexpr (Ordered<Order, Item>) {
            if (sorted) {
                for (uint32_t i = 0; i < n; ++i) keys[list[i]] = order_key<Order>(*scene_, queue, list[i]);
                std::sort(list, list + n,
                          [&](uint32_t a, uint32_t b) { return keys[a] != keys[b] ? keys[a] < keys[b] : a < b; });
            }
        }
        return list;
    }
    template <class Item>
    static bool take(const Queue<Item>& queue, uint32_t place) {
        const bool taken = queue.flags[place];
        queue.flags[place] = 0;
        return taken;
    }
    void record(StageId id, uint32_t items, Clock::time_point start) {
        const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start).count();
        records_[uint32_t(id)].add(items, state_->depth, uint64_t(ns));
    }

    WaveState* state_;
    StageRecord* records_;
    const SceneView* scene_ = nullptr;
    OrderMemory order_{};
};

}  // namespace ambilux
