// Trees of path guiding as the paths of a sample follow them. A replay learns what earlier iterations found by
// rendering these again, on the backend of the render.
#pragma once

#include <memory>
#include <mutex>

#include "backends/cpu/host_memory.h"
#include "backends/cpu/primitives.h"
#include "integrators/shared/guide/directions.h"
#include "integrators/shared/guide/records.h"
#include "render/replay/context.h"
#include "render/state_memory.h"

namespace ambilux {

/// What trees are like.
struct GuidePolicy {
    GuidedSettings guided;
    GuideTraining training;
};

/// The state of a guided method, in memory of the host; what StateMemory asks of its owner.
struct KeptGuide {
    using State = GuidedState;

    GuidePolicy policy;
    uint32_t appended = 0;
    GuidedState state{};
    StateMemory<HostMemory, KeptGuide> memory{*this};

    explicit KeptGuide(const GuidePolicy& p) : policy(p) {}
    GuidedState lay_out_state(Layout& layout) const {
        return GuidedState::lay_out(layout, policy, {0, host_primitive_bytes()});
    }
};

class ReplayedGuide {
public:
    ReplayedGuide(const Scene& scene, const RenderSettings& settings, const GuidePolicy& policy)
        : scene_(scene), settings_(settings), policy_(policy) {}

    bool roulette() const { return policy_.guided.roulette; }
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

/// `ctx` with paths that follow the trees of a sample.
template <class Mis>
std::shared_ptr<const ReplayContext<Mis>> guided_context(const ReplayContext<Mis>& ctx, const ReplayedGuide& guide,
                                                         uint32_t sample) {
    struct Whole {
        std::shared_ptr<const KeptGuide> kept;
        ReplayContext<Mis> ctx;
    };
    const auto whole = std::make_shared<Whole>(Whole{guide.at(sample), ctx});
    const GuideTree& tree = whole->kept->state.tree;
    whole->ctx.rules.directions = {tree, guide.roulette()};
    whole->ctx.rules.mis.tree = tree;
    return {whole, &whole->ctx};
}
/// What the camera ray of a sample knows of its pixel (ReplayJoins::start).
template <class Mis>
auto guided_start(const ReplayContext<Mis>& ctx, const ReplayedGuide& guide, const ReplayRequest& request) {
    const uint32_t across = (ctx.view.sensor.crop_width + kTileSide - 1) / kTileSide,
                   tile = request.y / kTileSide * across + request.x / kTileSide;
    const float over_pixel = guide.at(request.sample)->state.over_pixel[tile];
    return [over_pixel](Subpath<Mis>& path) { path.sums.over_pixel = over_pixel; };
}

}  // namespace ambilux
