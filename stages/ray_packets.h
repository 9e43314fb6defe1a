// Rays of a stage that traces, many at a time, on a host.
#pragma once

#include "accel/traceable.h"
#include "stages/fused_clock.h"

namespace ambilux {

namespace detail {

/// What a stage keeps of an item from fetch to finish.
template <class Stage>
struct KeptBy {
    struct Type {};
};
template <class Stage>
    requires Stage::kAnyHit
struct KeptBy<Stage> {
    using Type = typename Stage::Kept;
};

}  // namespace detail

/// Fetches rays of `Stage`, traces them together and finishes them in the order in which they came.
template <class Stage>
class RayPackets {
public:
    explicit RayPackets(const Stage& stage, bool coherent = false) : stage_(stage), coherent_(coherent) {}

    void add(uint32_t i) {
        bool valid;
        if constexpr (Stage::kAnyHit)
            valid = stage_.fetch(i, rays_[count_], kept_[count_]);
        else
            valid = stage_.fetch(i, rays_[count_]);
        if (!valid) return;
        places_[count_++] = i;
        if (count_ == kMostPacketRays) trace();
    }
    /// Traces what is left.
    void trace() {
        constexpr Features F = Stage::kFeatures;
        constexpr bool kTogether =
            requires(bool* blocked) { stage_.tracer.template occluded<F>(stage_.scene, rays_, 1u, true, blocked); };
        if constexpr (Stage::kAnyHit) {
            bool blocked[kMostPacketRays];
            if constexpr (kTogether)
                stage_.tracer.template occluded<F>(stage_.scene, rays_, count_, coherent_, blocked);
            else
                for (uint32_t k = 0; k < count_; ++k)
                    blocked[k] = stage_.tracer.template occluded<F>(stage_.scene, rays_[k]);
            for (uint32_t k = 0; k < count_; ++k) stage_.finish(places_[k], kept_[k], blocked[k]);
        } else {
            Hit hits[kMostPacketRays];
            if constexpr (kTogether)
                stage_.tracer.template closest<F>(stage_.scene, rays_, count_, coherent_, hits);
            else
                for (uint32_t k = 0; k < count_; ++k)
                    stage_.tracer.template closest<F>(stage_.scene, rays_[k], hits[k]);
            for (uint32_t k = 0; k < count_; ++k) stage_.finish(places_[k], hits[k]);
        }
        count_ = 0;
    }

private:
    const Stage& stage_;
    bool coherent_;
    uint32_t count_ = 0;
    uint32_t places_[kMostPacketRays];
    Ray rays_[kMostPacketRays];
    typename detail::KeptBy<Stage>::Type kept_[kMostPacketRays];
};

}  // namespace ambilux
