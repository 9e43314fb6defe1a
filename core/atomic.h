// Sums that threads of a device add to together. On a host they belong to one thread unless a function says otherwise.
#pragma once

#include <atomic>
#include <cstdint>

#include "core/vec.h"

namespace ambilux {

/// Less than 0: subtracts.
AMBILUX_HD void add_count(uint64_t* counter, int64_t n) {
#if defined(__CUDA_ARCH__)
    atomicAdd(reinterpret_cast<unsigned long long*>(counter), static_cast<unsigned long long>(n));
#else
    *counter += uint64_t(n);
#endif
}

/// One more. Returns what it was.
AMBILUX_HD uint32_t fetch_add(uint32_t* counter) {
#if defined(__CUDA_ARCH__)
    return atomicAdd(counter, 1u);
#else
    return (*counter)++;
#endif
}

/// Threads of a host may share `sum` too. Returns what it was.
AMBILUX_HD int64_t fetch_add_shared(int64_t* sum, int64_t value) {
#if defined(__CUDA_ARCH__)
    return static_cast<int64_t>(
        atomicAdd(reinterpret_cast<unsigned long long*>(sum), static_cast<unsigned long long>(value)));
#else
    return __atomic_fetch_add(sum, value, __ATOMIC_RELAXED);
#endif
}

/// Adds `n` unless the sum would be more than `most`; threads of a host may share `sum`, one thread of a device adds.
/// False if it would; else `before` is what it was.
AMBILUX_HD bool add_up_to(uint32_t* sum, uint32_t n, uint32_t most, uint32_t& before) {
#if defined(__CUDA_ARCH__)
    before = *sum;
    if (before > most || n > most - before) return false;
    *sum = before + n;
    return true;
#else
    const std::atomic_ref<uint32_t> shared(*sum);
    before = shared.load(std::memory_order_relaxed);
    do {
        if (before > most || n > most - before) return false;
    } while (!shared.compare_exchange_weak(before, before + n, std::memory_order_relaxed));
    return true;
#endif
}

/// The largest of `value` and what others, likewise, have raised it to.
AMBILUX_HD void raise_shared(uint64_t* most, uint64_t value) {
#if defined(__CUDA_ARCH__)
    if (*most < value) *most = value;
#else
    const std::atomic_ref<uint64_t> shared(*most);
    for (uint64_t before = shared; before < value && !shared.compare_exchange_weak(before, value);) {}
#endif
}

/// Threads of a host may share `sum` too.
AMBILUX_HD void add_shared(double* sum, double value) {
#if defined(__CUDA_ARCH__)
    atomicAdd(sum, value);
#else
    std::atomic_ref<double>(*sum).fetch_add(value, std::memory_order_relaxed);
#endif
}

AMBILUX_HD void add_double(double* sum, double value) {
#if defined(__CUDA_ARCH__)
    atomicAdd(sum, value);
#else
    *sum += value;
#endif
}

/// Adds to the first three of four floats, aligned to 16 bytes.
AMBILUX_HD void add_rgb(float* sum, Rgb value) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    atomicAdd(reinterpret_cast<float4*>(sum), make_float4(value.x, value.y, value.z, 0.0f));
#elif defined(__CUDA_ARCH__)
    for (int k = 0; k < 3; ++k) atomicAdd(sum + k, value[k]);
#else
    for (int k = 0; k < 3; ++k) sum[k] += value[k];
#endif
}

/// Asks for the cache line at `address`, which will be needed soon.
AMBILUX_HD void prefetch_line([[maybe_unused]] const void* address) {
#if defined(__CUDA_ARCH__)
    asm volatile("prefetch.global.L2 [%0];" ::"l"(address));
#elif defined(__GNUC__)
    __builtin_prefetch(address, 1);
#endif
}

}  // namespace ambilux
