// Runs stages between the phases of an iteration on all threads, over what all waves have left.
#pragma once

#include <chrono>
#include <mutex>

#include "backends/cpu/primitives.h"
#include "core/parallel.h"
#include "queues/queue.h"
#include "queues/stage_record.h"

namespace ambilux {

class CpuWholeExecutor {
public:
    static constexpr bool kHost = true;

    /// Over numbers below `n`.
    template <class Stage>
    void for_each(const Stage& stage, uint32_t n) {
        const auto start = Clock::now();
        std::mutex mutex;
        constexpr uint32_t kBlock = 64;
        parallel_for((n + kBlock - 1) / kBlock, [&](uint32_t block) {
            Stage mine = stage;
            StageRecord record{};
            mine.record = &record;
            for (uint32_t i = block * kBlock; i < std::min(n, (block + 1) * kBlock); ++i) mine(i);
            if (record.nan + record.inf + record.negative + record.underflow == 0) return;
            const std::lock_guard lock(mutex);
            stage.record->add(record);
        });
        stage.record->add(n, 0, elapsed(start));
    }
    /// Over the items of a queue, which stay.
    template <class Stage, class Item>
    void for_each(const Stage& stage, const Queue<Item>& queue) {
        for_each(stage, count(queue));
    }
    template <class Stage>
    void run_slots(const Stage& stage, uint32_t slots, uint32_t samples) {
        for_each(stage, slots * samples);
    }
    template <class Item>
    uint32_t count(const Queue<Item>& queue) const {
        return queue.counter->size();
    }
    template <class Item>
    void clear(const Queue<Item>& queue) {
        queue.counter->finish();
    }
    /// Of the first `n` pairs, by the lowest `bits` bits.
    template <class Key>
    void sort_pairs(const SortMemory<Key>& m, uint32_t n, uint32_t bits, StageRecord* record) {
        const auto start = Clock::now();
        sort_pairs_together(m, n, bits);
        record->nanoseconds += elapsed(start);
    }
    /// Exclusive sums; `out` may be `in`.
    void scan(const ScanMemory&, const uint32_t* in, uint32_t* out, uint32_t n, StageRecord* record) {
        const auto start = Clock::now();
        scan_together(in, out, n);
        record->nanoseconds += elapsed(start);
    }

private:
    using Clock = std::chrono::steady_clock;

    static uint64_t elapsed(Clock::time_point start) {
        return uint64_t(std::chrono::nanoseconds(Clock::now() - start).count());
    }
};

}  // namespace ambilux
