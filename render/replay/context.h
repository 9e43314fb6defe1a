// What all parts of a replay read.
#pragma once

#include "accel/host_tracer.h"
#include "integrators/bdpt/shared/policy.h"
#include "stages/stage.h"

namespace ambilux {

/// Replays are compiled once: kernels of fewer features differ by roundings only.
constexpr Features kReplayFeatures = kAllFeatures;

template <class Mis>
struct ReplayContext {
    SceneView view;
    HostTracer tracer;
    Rules<Mis> rules;
    float cull = 0;
    bool radiance_first = false;  ///< variant megakernel: the environment's radiance is looked up before the weight
};

/// Counts what a stage dropped, and remembers the first stage that did.
class DropWatch {
public:
    StageRecord* record() {
        record_ = {};
        return &record_;
    }
    /// True if the stage `name` has dropped something since record().
    bool dropped(const char* name, std::string& by) const {
        const bool any = record_.nan + record_.inf + record_.negative > 0;
        if (any && by.empty()) by = name;
        return any;
    }

private:
    StageRecord record_{};
};

/// Nearest hit of a subpath's ray, as extend has it: a ray that is invalid is a miss, and counted.
template <class Mis>
Hit replay_extend(const ReplayContext<Mis>& ctx, const Subpath<Mis>& path, float tmax, const Draws& draws,
                  StageRecord* record) {
    Hit hit = {tmax, 0.0f, 0.0f, kNone};
    if (is_valid_ray(path.origin, path.direction, record))
        ctx.tracer.template closest<kReplayFeatures>(
            ctx.view, Ray{path.origin, tmax, path.direction, draws.opacity_seed(path.depth)}, hit);
    return hit;
}

}  // namespace ambilux
