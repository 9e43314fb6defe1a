// What all parts of a replay read.
#pragma once

#include "accel/host_tracer.h"
#include "integrators/bdpt/shared/policy.h"
#include "render/replay/replay.h"
#include "stages/stage.h"
#include "stages/update_film.h"
#include "transport/subpath/trace.h"

namespace ambilux {

/// Replays are compiled once: kernels of fewer features differ by roundings only.
constexpr Features kReplayFeatures = kAllFeatures;

template <class Mis>
struct ReplayContext {
    SceneView view;
    HostTracer tracer;
    Rules<Mis> rules;
    float cull = 0;
    bool radiance_first =
        false;  ///< ReplayPairing::registers: the environment's radiance is looked up before the weight
};

/// Sees what a stage drops.
class DropWatch {
public:
    StageRecord* record() {
        record_ = {};
        return &record_;
    }
    /// True if the stage `name` has dropped something since record(); `drop` keeps the first.
    bool dropped(const char* name, ReplayDrop& drop) const {
        if (record_.nan + record_.inf + record_.negative == 0) return false;
        if (!drop.happened()) drop = {name, record_.nan ? "NaN" : record_.inf ? "Inf" : "negative"};
        return true;
    }

private:
    StageRecord record_{};
};

/// Of the requested sample, nothing yet.
inline ReplaySample blank_sample(const ReplayRequest& request, uint64_t seed) {
    ReplaySample s;
    s.x = request.x;
    s.y = request.y;
    s.sample = request.sample;
    s.seed = seed;
    return s;
}

/// The sum of a sample, as update_film has it.
inline void finish(ReplaySample& s) {
    for (int c = 0; c < 3; ++c) s.total[c] = s.splat_sum[c] + double(s.eye_sum[c]);
    DropWatch watch;
    const Rgb total = {float(s.total[0]), float(s.total[1]), float(s.total[2])};
    if (!is_valid_radiance(total, watch.record())) watch.dropped(UpdateFilm::kName, s.drop);
}

/// Nearest hit of a subpath's ray, as extend has it: a ray that is invalid is a miss, and counted.
template <class Mis>
Hit replay_extend(const ReplayContext<Mis>& ctx, const Subpath<Mis>& path, float tmax, const RandomNumbers& numbers,
                  StageRecord* record) {
    if (!is_valid_ray(path.origin, path.direction, record)) return {tmax, 0.0f, 0.0f, kNone};
    return end_of_ray<kReplayFeatures>(ctx.view, ctx.tracer, path, tmax, numbers);
}

}  // namespace ambilux
