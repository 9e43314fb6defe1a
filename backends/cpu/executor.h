// Runs the stages of one wave on the calling thread, over queues that belong to it alone.
#pragma once

#include <chrono>

#include "queues/queue.h"
#include "stages/settle.h"
#include "stages/stage.h"
#include "stages/wave.h"

namespace ambilux {

class CpuExecutor {
public:
    CpuExecutor(WaveState* state, StageRecord* records) : state_(state), records_(records) {}

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
        run_keeping(id, stage, queue);
        queue.counter->finish();
    }
    template <class Stage, class Item>
    void run_keeping(StageId id, const Stage& stage, const Queue<Item>& queue) {
        const uint32_t n = queue.counter->size();
        if (n == 0) return;
        const auto start = Clock::now();
        for (uint32_t i = 0; i < n; ++i) {
            if constexpr (requires { stage.far_memory(i); }) {
                if (i + kPrefetchDistance < n) __builtin_prefetch(stage.far_memory(i + kPrefetchDistance));
            }
            stage(i);
        }
        record(id, n, start);
    }
    /// Rays are read before any stage pushes new ones, so the queue they came from may be filled again at once.
    template <class Stage, class Item>
    void trace(StageId id, const Stage& stage, const Queue<Item>& queue) {
        run(id, stage, queue);
    }
    template <class Stage, class Item>
    void trace_coherent(StageId id, const Stage& stage, const Queue<Item>& queue) {
        run(id, stage, queue);
    }
    template <class Item, class Body>
    void repeat_while(const Queue<Item>& queue, Body body) {
        while (queue.counter->count > 0) body();
    }
    template <class A, class B>
    void settle(const A& a, const B& b) {
        ambilux::settle(*state_, *a.counter, *b.counter);
    }
    template <class Item, LaneOrder Order>
    void clear(const Queue<Item, Order>& queue) {
        queue.counter->finish();
    }
    void set_depth(uint32_t depth) { state_->depth = depth; }
    void next_depth() { ++state_->depth; }

private:
    using Clock = std::chrono::steady_clock;
    static constexpr uint32_t kPrefetchDistance = 8;  ///< items; further or nearer makes no difference between 4 and 16
    void record(StageId id, uint32_t items, Clock::time_point start) {
        const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start).count();
        records_[uint32_t(id)].add(items, state_->depth, uint64_t(ns));
    }

    WaveState* state_;
    StageRecord* records_;
};

}  // namespace ambilux
