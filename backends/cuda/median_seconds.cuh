// Times of launches by CUDA events.
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "backends/bench_rays.h"
#include "backends/cuda/device_memory.h"

namespace ambilux {

struct DeviceEvent {
    cudaEvent_t event = nullptr;
    DeviceEvent() { cuda_check(cudaEventCreate(&event), "event"); }
    ~DeviceEvent() { cudaEventDestroy(event); }
    DeviceEvent(const DeviceEvent&) = delete;
    DeviceEvent& operator=(const DeviceEvent&) = delete;
};

/// Keeps the device from what is queued next.
__global__ inline void hold_device(long long cycles) {
    for (const long long start = clock64(); clock64() - start < cycles;) __nanosleep(1000);
}

/// Median times of launches[k](i) for i from warm_ups to warm_ups + repetitions; for each i all are launched on the
/// default stream, one after the other. The device is held while the host queues them: between an event and a kernel on
/// an idle device lies the time of the launch. `what` names them in the message of a failure.
inline std::vector<double> median_seconds(const char* what, int warm_ups, int repetitions,
                                          const std::vector<std::function<void(size_t)>>& launches) {
    const size_t runs = size_t(warm_ups + repetitions), steps = launches.size();
    const std::vector<DeviceEvent> starts(runs * steps), stops(runs * steps);
    hold_device<<<1, 1>>>(static_cast<long long>(std::min<size_t>(runs * steps, 1000)) *
                          20000);  // about 10 microseconds each, as many as a device takes ahead
    for (size_t e = 0; e < runs * steps; ++e) {
        cuda_check(cudaEventRecord(starts[e].event), "event");
        launches[e % steps](e / steps);
        cuda_check(cudaGetLastError(), what);
        cuda_check(cudaEventRecord(stops[e].event), "event");
    }
    cuda_check(cudaDeviceSynchronize(), what);
    std::vector<double> medians;
    for (size_t k = 0; k < steps; ++k) {
        std::vector<double> seconds;
        for (size_t i = size_t(warm_ups); i < runs; ++i) {
            float milliseconds = 0;
            cuda_check(cudaEventElapsedTime(&milliseconds, starts[i * steps + k].event, stops[i * steps + k].event),
                       "event");
            seconds.push_back(double(milliseconds) * 1e-3);
        }
        medians.push_back(median(std::move(seconds)));
    }
    return medians;
}

}  // namespace ambilux
