// Time of stages that run inside of others, on a host: their own, without what runs inside of them in turn.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>

#include "queues/stage_record.h"

namespace ambilux {

/// How often a thread looks at the clock, and what its stages inside of others took.
class FusedTime {
public:
    static constexpr int64_t kOnceIn = 16;  ///< calls of a sampled stage, on average

    /// Nanoseconds of stages inside of others so far: the difference over a launch is no time of the stage that was
    /// launched. What is sampled is an estimate.
    static int64_t inside() { return inside_; }

    /// True for one call of kOnceIn. Each call has the same chance, whatever those before it had (a geometric gap):
    /// no pattern of calls meets that of looks.
    static bool looks() {
        if (--calls_left_ > 0) return false;
        calls_left_ = gap();
        return true;
    }

private:
    friend class FusedClock;

    __attribute__((noinline)) static int32_t gap() {
        random_ ^= random_ << 13;  // xorshift (Marsaglia 2003)
        random_ ^= random_ >> 17;
        random_ ^= random_ << 5;
        static const float scale = 1.0f / std::log1p(-1.0f / float(kOnceIn));
        return 1 + int32_t(std::log(float(random_) * 0x1p-32f) * scale);
    }

    static inline thread_local int64_t inside_ = 0;
    static inline thread_local int32_t calls_left_ = 1;
    static inline thread_local uint32_t random_ = 0x9e3779b9u;
};

/// While it lives, its stage runs.
class FusedClock {
public:
    /// Sampled: for stages that take no longer than ten looks at the clock.
    explicit FusedClock(StageRecord* record, bool sampled = false)
        : record_(record), weight_(!sampled             ? 1
                                   : FusedTime::looks() ? FusedTime::kOnceIn
                                                        : 0) {
        if (weight_) start();
    }
    ~FusedClock() {
        if (weight_) stop();
    }
    FusedClock(const FusedClock&) = delete;
    FusedClock& operator=(const FusedClock&) = delete;

private:
    /// Nanoseconds. A sampled stage that took longer was interrupted: on a busy machine the thread waited, and that
    /// counts once.
    static constexpr int64_t kInterrupted = 50'000;

    static int64_t now() {
        const auto since = std::chrono::steady_clock::now().time_since_epoch();
        return std::chrono::duration_cast<std::chrono::nanoseconds>(since).count();
    }
    /// What a clock measures that starts and stops at once: the median of many.
    static int64_t of_nothing() {
        int64_t found[101];
        for (int64_t& f : found) {
            const int64_t before = now();
            f = now() - before;
        }
        std::nth_element(found, found + 50, found + 101);
        return found[50];
    }
    __attribute__((noinline)) void start() {
        static const int64_t nothing = of_nothing();
        start_ = now() + nothing - FusedTime::inside_;
    }
    __attribute__((noinline)) void stop() {
        int64_t own = now() - start_ - FusedTime::inside_;
        if (own < kInterrupted) own *= weight_;
        record_->nanoseconds += uint64_t(own);  // below zero for a while where a sampled stage runs inside
        FusedTime::inside_ += own;
    }

    StageRecord* record_;
    int64_t weight_, start_ = 0;
};

}  // namespace ambilux
