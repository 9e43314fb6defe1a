// Keeps the reader of one file within the limits. Readers ask before they allocate, and tick while they work.
#pragma once

#include <chrono>
#include <string>

#include "formats/limits.h"

namespace ambilux {

class FileBudget {
public:
    /// The clock starts now.
    explicit FileBudget(std::string path, const Limits& limits = {});

    const std::string& path() const { return path_; }
    const Limits& limits() const { return limits_; }

    /// Throws Error(bad_input) that names the file.
    [[noreturn]] void fail(const std::string& message, int line = 0) const;
    /// The size of an image, both at least 1. Throws if it has more pixels than allowed.
    void pixels(uint64_t width, uint64_t height) const;
    /// `count` things of `size` bytes. Throws if they are too many; no product overflows.
    void bytes(uint64_t count, uint64_t size = 1) const;
    /// True once the time is over. Looks at the clock.
    bool expired() const;
    /// Throws then.
    void check_time() const;
    /// Called again and again while reading; throws once the time is over.
    void tick(uint64_t entries = 1) {
        if ((ticks_ += entries) >= 1024) ticks_ = 0, check_time();
    }

private:
    std::string path_;
    Limits limits_;
    std::chrono::steady_clock::time_point start_;
    uint64_t ticks_ = 0;
};

/// Whole content of a regular file of at most limits.bytes. Throws Error(bad_input) that names it: pipes and devices
/// are refused, since they need not end.
std::string read_input(const std::string& path, const Limits& limits = {});

}  // namespace ambilux
