// A flag that is set when another one is, or when time is over.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "core/flag.h"

namespace ambilux::stress {

class Deadline {
public:
    /// `seconds` from now; 0: never.
    Deadline(const volatile bool* other, double seconds)
        : thread_([this, other, seconds](const std::stop_token& stop) { watch(stop, other, seconds); }) {}

    const volatile bool* flag() const { return &flag_; }

private:
    void watch(const std::stop_token& stop, const volatile bool* other, double seconds) {
        const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
        std::unique_lock lock(mutex_);
        while (!stop.stop_requested()) {
            if (is_set(other) || (seconds > 0 && std::chrono::steady_clock::now() >= end)) return set_flag(&flag_);
            wake_.wait_for(lock, stop, std::chrono::milliseconds(20), [] { return false; });
        }
    }

    volatile bool flag_ = false;
    std::mutex mutex_;
    std::condition_variable_any wake_;
    std::jthread thread_;  ///< the last: it uses the others
};

}  // namespace ambilux::stress
