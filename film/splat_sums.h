// What light subpaths bring to the pixels.
#pragma once

#include <thread>

#include "core/atomic.h"
#include "core/lane.h"
#include "core/math.h"
#include "core/warp.h"

namespace ambilux {

/// Adds up what the lanes of `same` have, finite and not negative, with an error of at most 2^-36 of the largest value:
/// true for the lane that is left with the sum.
AMBILUX_HD bool gather_light([[maybe_unused]] SameKey same, [[maybe_unused]] Rgb& light) {
#if defined(__CUDA_ARCH__)
    if (!same.has_several_lanes()) return true;
    // Whole numbers below 2^42, in units that follow the largest value. Bits of positive floats are in their order.
    const uint32_t exponent = __reduce_max_sync(same.lanes, float_bits(max_component(light))) >> 23;
    const double scale = __hiloint2double(int(1023 + 41 + 126 - exponent) << 20, 0);
    const double unit = __hiloint2double(int(1023 - 41 - 126 + exponent) << 20, 0);
    constexpr uint32_t kHalf = (1u << 21) - 1;
    for (int c = 0; c < 3; ++c) {
        const int64_t value = llrint(double(light[c]) * scale);
        const uint32_t low = __reduce_add_sync(same.lanes, uint32_t(value) & kHalf);
        const uint32_t high = __reduce_add_sync(same.lanes, uint32_t(value >> 21));
        light[c] = float(double((int64_t(high) << 21) + low) * unit);
    }
    return same.is_first();
#else
    return true;
#endif
}

/// While it lives, no other thread of a host adds to the cells of a row of pixels: one lock takes less time than atomic
/// operations for three numbers of each cell. Nothing on a device.
class SplatRow {
public:
    AMBILUX_HD explicit SplatRow([[maybe_unused]] uint32_t row) {
#if !defined(__CUDA_ARCH__)
        lock_ = &locks_[row % kLocks].flag;
        while (lock_->test_and_set(std::memory_order_acquire)) std::this_thread::yield();
#endif
    }
    AMBILUX_HD ~SplatRow() {
#if !defined(__CUDA_ARCH__)
        lock_->clear(std::memory_order_release);
#endif
    }
    SplatRow(const SplatRow&) = delete;
    SplatRow& operator=(const SplatRow&) = delete;

private:
    struct alignas(64) Lock {
        std::atomic_flag flag;
    };
    static constexpr uint32_t kLocks = 128;
    static inline Lock locks_[kLocks];
    std::atomic_flag* lock_ = nullptr;
};

/// A cell per pixel and sample of a wave, of one of two kinds. A sum of floats in doubles is exact, so that it does not
/// depend on the order in which threads add, while the values of a cell lie within a factor of 2^28; beyond that its
/// error is below 2^-52 of the sum. A cell of floats takes one operation of memory instead of three: n values are added
/// up with an error of at most n 2^-24 of their sum. Neither has a unit: scaling all light scales the sums. What is too
/// much for a float is counted where the film is updated.
struct SplatSums {
    double* doubles = nullptr;  ///< three per cell
    Lane* floats = nullptr;     ///< or a lane per cell

    AMBILUX_HD bool exists() const { return doubles || floats; }
    /// `value`: finite, not negative. A host has locked the row, or nobody else adds. `alone`: few other threads of the
    /// warp, if any, add to the same cell.
    AMBILUX_HD void add(uint64_t cell, Rgb value, bool alone) const {
        if (doubles) {
            for (int c = 0; c < 3; ++c) add_double(doubles + cell * 3 + c, double(value[c]));
            return;
        }
        if (!alone && !gather_light(same_key(reinterpret_cast<uintptr_t>(floats + cell)), value)) return;
        add_rgb(reinterpret_cast<float*>(floats + cell), value);
    }
    /// Asks for a cell and the next one.
    void prefetch(uint64_t cell) const {
        if (!doubles) return prefetch_line(floats + cell);
        prefetch_line(doubles + cell * 3);
        prefetch_line(doubles + cell * 3 + 5);
    }
    AMBILUX_HD void read(uint64_t cell, double (&value)[3]) const {
        const Rgb sum = doubles ? Rgb{} : start_of<Rgb>(floats[cell]);
        for (int c = 0; c < 3; ++c) value[c] = doubles ? doubles[cell * 3 + c] : double(sum[c]);
    }
    AMBILUX_HD void clear(uint64_t cell) const {
        if (!doubles)
            floats[cell] = {};
        else
            for (int c = 0; c < 3; ++c) doubles[cell * 3 + c] = 0.0;
    }
};

}  // namespace ambilux
