// Adds up how long parts of the work take.
#pragma once

#include <chrono>

namespace ambilux {

/// Adds the seconds from its construction to its end to a sum, unless that is null.
class ScopedSeconds {
public:
    explicit ScopedSeconds(double* sum) : sum_(sum), start_(std::chrono::steady_clock::now()) {}
    ~ScopedSeconds() {
        if (sum_) *sum_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }
    ScopedSeconds(const ScopedSeconds&) = delete;
    ScopedSeconds& operator=(const ScopedSeconds&) = delete;

private:
    double* sum_;
    std::chrono::steady_clock::time_point start_;
};

}  // namespace ambilux
