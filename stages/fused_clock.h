// Time of stages that run inside of others, on a host: their own, without what runs inside of them in turn.
#pragma once

#include <chrono>

#include "queues/stage_record.h"

namespace ambilux {

/// While it lives, its stage runs. With `every` above 1 it looks at the clock once in as many calls of a thread, and
/// counts that time as often: two looks take as long as a tenth of a shadow ray.
class FusedClock {
public:
    explicit FusedClock(StageRecord* record, uint32_t every = 1) : record_(record), weight_(every) {
        if (every > 1 && calls++ % every != 0) weight_ = 0;
        if (weight_) start();
    }
    ~FusedClock() {
        if (!weight_) return;
        const int64_t own = weight_ * (now() - start_ - (inside_ - inside_before_));
        record_->nanoseconds += uint64_t(own);  // of a sampled stage below zero at times: sums are right
        inside_ += own;
    }
    FusedClock(const FusedClock&) = delete;
    FusedClock& operator=(const FusedClock&) = delete;

    /// Nanoseconds of this thread that stages inside of others took so far: the difference over a launch is no time of
    /// the stage that was launched.
    static int64_t inside() { return inside_; }

private:
    static int64_t now() {
        const auto since = std::chrono::steady_clock::now().time_since_epoch();
        return std::chrono::duration_cast<std::chrono::nanoseconds>(since).count();
    }
    void start() {
        inside_before_ = inside_;
        start_ = now();
    }

    static inline thread_local int64_t inside_ = 0;
    static inline thread_local uint32_t calls = 0;
    StageRecord* record_;
    int64_t weight_, start_ = 0, inside_before_ = 0;
};

}  // namespace ambilux
