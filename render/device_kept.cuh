// What an integrator keeps on a device from wave to wave, such as what variant learned has learned.
#pragma once

#include "backends/cuda/device_memory.h"
#include "integrators/keeps.h"

namespace ambilux {

template <class Integrator>
class DeviceKept {
    using Policy = typename Integrator::Policy;

public:
    /// Bytes that it will take.
    uint64_t plan([[maybe_unused]] Policy& policy) {
        if constexpr (KeepsBetweenWaves<Integrator>) {
            Layout layout;
            Integrator::lay_out_kept(layout, policy);
            planned_ = layout.bytes();
        }
        return planned_;
    }
    void allocate([[maybe_unused]] Policy& policy) {
        if constexpr (KeepsBetweenWaves<Integrator>) {
            Layout layout;
            Integrator::lay_out_kept(layout, policy);
            memory_ = DeviceBuffer<std::byte>(layout.bytes(), "what waves learn");
            memory_.zero();
            Layout placed(layout, memory_.data());
            Integrator::lay_out_kept(placed, policy);
            Integrator::fill_kept(policy, [](auto* to, const auto& values) {
                cuda_check(cudaMemcpy(to, values.data(), values.size() * sizeof(*to), cudaMemcpyHostToDevice),
                           "what waves learn");
            });
        }
    }
    uint64_t planned() const { return planned_; }
    uint64_t bytes() const { return memory_.bytes(); }

private:
    uint64_t planned_ = 0;
    DeviceBuffer<std::byte> memory_;
};

}  // namespace ambilux
