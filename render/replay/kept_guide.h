// Trees of path guiding as the paths of a sample follow them. A replay learns what earlier iterations found by
// rendering these again, on the backend of the render.
#pragma once

#include <memory>
#include <mutex>

#include "backends/cpu/host_memory.h"
#include "backends/cpu/primitives.h"
#include "integrators/shared/guide/training.h"
#include "render/replay/replay.h"
#include "render/state_memory.h"

namespace ambilux {

/// What trees are like.
struct GuidePolicy {
    GuidedSettings guided;
    GuideTraining training;
};

/// The state of a guided method, in memory of the host; what StateMemory asks of its owner.
struct KeptGuide {
    using State = GuidedStates;

    GuidePolicy policy;
    uint32_t appended = 0;
    GuidedStates state{};
    StateMemory<HostMemory, KeptGuide> memory{*this};

    explicit KeptGuide(const GuidePolicy& p) : policy(p) {}
    GuidedStates lay_out_state(Layout& layout) const {
        return GuidedStates::lay_out(layout, policy, {0, host_primitive_bytes()});
    }
};

/// Makes the trees that samples of a render follow, and keeps the last ones.
class ReplayedGuide {
public:
    ReplayedGuide(const Scene& scene, const RenderSettings& settings, const GuidePolicy& policy)
        : scene_(scene), settings_(settings), policy_(policy) {}

    const GuidedSettings& settings() const { return policy_.guided; }
    uint32_t iteration_samples() const { return policy_.guided.iteration_samples; }
    /// As the iteration of this sample begins, trained.
    std::shared_ptr<const KeptGuide> at(uint32_t sample) const;

private:
    std::shared_ptr<const KeptGuide> made(uint32_t iteration) const;

    const Scene& scene_;
    RenderSettings settings_;
    GuidePolicy policy_;
    mutable std::mutex mutex_;
    mutable std::unique_ptr<Renderer> renderer_;  ///< has done `done_` iterations
    mutable uint32_t done_ = 0, last_ = ~0u;
    mutable std::shared_ptr<const KeptGuide> kept_;  ///< of iteration `last_`
};

}  // namespace ambilux
