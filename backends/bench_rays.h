// Throughput of ray traversal alone.
#pragma once

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace ambilux {

/// Traces the batches of backends/ray_batches.h `repetitions` times each, after 3 runs that do not count.
/// `backend`: cpu (Embree), cpu-single (without packets), cuda (CWBVH), cuda-fast (that of the fast builder, whose
/// seconds are those of the device), cuda-bvh2 (a binary BVH), cuda-optix (OptiX), cpu-cwbvh, cpu-fast and cpu-bvh2
/// (the same on the host), or auto, which is cuda where there is a device and else cpu. On the CPU, batches have 512 x
/// 512 paths, on CUDA 2048 x 2048. `opaque`: surfaces of partial opacity stop every ray, and bounces start from them.
/// Result: backend, opaque, device, accel, build_seconds, accel_bytes, repetitions, and rows of batch, count (rays),
/// hit (fraction of rays), kernel, tuning and mrays_per_s (median; CUDA events, or the clock over all threads). On CUDA
/// the first row of each batch is what renders use. Throws Error(usage) for another backend or no repetitions,
/// Error(device) for cuda without a device.
nlohmann::json bench_rays(const Scene& scene, const std::string& backend, int repetitions, bool opaque = false);

constexpr int kBenchWarmUps = 3;

/// What each of `repetitions` calls of run() returns, after kBenchWarmUps that do not count.
template <class Run>
auto runs_that_count(int repetitions, const Run& run) {
    for (int i = 0; i < kBenchWarmUps; ++i) run();
    std::vector<decltype(run())> all;
    for (int i = 0; i < repetitions; ++i) all.push_back(run());
    return all;
}

/// The seconds that each of them takes.
template <class Run>
std::vector<double> seconds_of_runs(int repetitions, const Run& run) {
    return runs_that_count(repetitions, [&] {
        const auto start = std::chrono::steady_clock::now();
        run();
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    });
}

/// The middle of `seconds`, which must not be empty; of an even number the mean of the middle two.
double median(std::vector<double> seconds);

}  // namespace ambilux
