// What rays of a device go through: a wide BVH by the good builder or by the device itself, a binary one, or OptiX's.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "accel/host_tracer.h"
#include "accel/shared_accels.h"
#include "backends/cuda/device_optix.h"
#include "backends/cuda/device_scene.h"
#include "backends/fast_cwbvh.h"
#include "core/error.h"
#include "core/log.h"
#include "integrators/settings.h"

namespace ambilux {

class DeviceStructure {
public:
    /// True of those that the device builds, from a scene that is there.
    static bool built_on_device(const RenderSettings& settings) {
        return settings.build == Build::fast || settings.accel == AccelKind::optix;
    }
    /// Finds or builds it: the device's own within `room` bytes beside the scene, the others on the host. Returns what
    /// a pilot traces with, if `pilot` asks for that.
    HostTracer find(const Scene& scene, const RenderSettings& settings, SharedAccels& accels, uint64_t room,
                    bool pilot) {
        if (settings.accel == AccelKind::bvh2) {
            host_pairs_.emplace(scene);
            bytes_ = host_pairs_->arrays().bytes();
            return {};
        }
        if (settings.accel == AccelKind::optix) {
            optix_ = std::make_unique<DeviceOptix>(scene, accels.get<DeviceScene>()->view(), room);
            bytes_ = optix_->facts().bytes;
            return pilot ? HostTracer(accels.get<CwbvhAccel>()->tracer()) : HostTracer();  // as with cwbvh
        }
        if (settings.build == Build::fast) build_fast(scene, settings, accels, room);
        if (fast_) {
            bytes_ = fast_->bytes();
            return pilot ? HostTracer(accels.get<FastCwbvhAccel>()->tracer()) : HostTracer();  // the same, to the bit
        }
        const auto accel = accels.get<CwbvhAccel>();
        bytes_ = accel->arrays().bytes();
        return HostTracer(accel->tracer());
    }
    void upload(SharedAccels& accels, CwbvhTracer& tracer) {
        if (optix_) return;
        if (host_pairs_) {
            pairs_.emplace(host_pairs_->arrays());
            host_pairs_.reset();
        } else {
            wide_ = fast_ ? fast_ : accels.get<DeviceCwbvh>();
            tracer = wide_->tracer();
        }
    }
    /// As find() knows them.
    uint64_t bytes() const { return bytes_; }
    uint64_t resident_bytes() const {
        return optix_ ? optix_->facts().bytes : pairs_ ? pairs_->bytes() : wide_->bytes();
    }
    /// While a device has built it.
    uint64_t peak_bytes() const { return optix_ ? optix_->facts().peak_bytes : fast_ ? fast_->peak_bytes() : 0; }
    const char* name() const { return optix_ ? "optix" : pairs_ ? "bvh2" : "cwbvh"; }
    /// Null unless the device has built it.
    const DeviceFastCwbvh* fast() const { return fast_.get(); }
    const std::optional<DevicePairs>& pairs() const { return pairs_; }
    /// Null unless accel=optix.
    DeviceOptix* optix() const { return optix_.get(); }

private:
    /// Leaves fast_ empty, with a line in the log, if memory or the depth of the tree forbids it.
    void build_fast(const Scene& scene, const RenderSettings& settings, SharedAccels& accels, uint64_t room) {
        try {
            const uint64_t needed = DeviceFastCwbvh::predicted_peak_bytes(scene.view());
            if (needed > room)
                throw Error(ExitCode::device, "build=fast: it needs " + std::to_string(needed >> 20) +
                                                  " MiB for a while, of " + std::to_string(room >> 20) + " there are");
            fast_ = accels.get<DeviceFastCwbvh>();
        } catch (const Error& e) {
            if (!settings.may_build_fast) throw;
            log_info(std::string(e.what()) + ". The good builder takes over");
        }
    }

    std::optional<PairAccel> host_pairs_;  ///< until they are on the device
    std::shared_ptr<const DeviceCwbvh> wide_;
    std::shared_ptr<const DeviceFastCwbvh> fast_;  ///< it, if the device has built it
    std::optional<DevicePairs> pairs_;             ///< instead, with accel=bvh2
    std::unique_ptr<DeviceOptix> optix_;           ///< instead, with accel=optix
    uint64_t bytes_ = 0;
};

}  // namespace ambilux
