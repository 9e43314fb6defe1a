#include "core/error.h"
#include "integrators/path/integrator.h"
#include "integrators/path/ris/ris.h"
#include "render/replay/eye.h"
#include "render/replay/make.h"

namespace ambilux {
namespace {

using Eye = ReplayEye<UnidirectionalMis>;

/// Variant ris has another stage in the place of next event estimation.
Eye::SampleEmitter resampled(const RisSettings& settings) {
    return [settings](const ReplayContext<UnidirectionalMis>& ctx, const Vertex<UnidirectionalMis>& z,
                      const Subpath<UnidirectionalMis>& path, const RandomNumbers& numbers, StageRecord* record,
                      CandidateItem& item) {
        bool pushed = false;
        const ResampledNextEvent<kReplayFeatures, UnidirectionalMis, LastItem<CandidateItem>> stage = {
            {&item, &pushed}, record, true, settings};
        return push_next_event(ctx, stage, z, path, numbers);
    };
}

class PathReplay final : public Replay {
public:
    PathReplay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer) : seed_(settings.seed) {
        const PathPolicy policy = plan_path(scene, settings);
        ctx_ = {scene.view(), tracer, policy.rules, policy.waves.cull, false};
        sample_emitter_ = settings.variant == "ris" ? resampled(RisSettings::plan(settings))
                                                    : Eye::SampleEmitter(sample_next_event<UnidirectionalMis>);
    }

    ReplaySample sample(const ReplayRequest& request) const override {
        ReplaySample out = blank_sample(request, seed_);
        replay_eye<UnidirectionalMis>(ctx_, sample_emitter_, {}, request.details, out);
        finish(out);
        return out;
    }
    ReplaySubpath light_subpath(uint32_t, uint32_t, bool, std::vector<ReplayCandidate>&) const override {
        throw Error(ExitCode::usage, "--light-subpath: integrator path has no light subpaths; light and bdpt have");
    }

private:
    uint64_t seed_;
    ReplayContext<UnidirectionalMis> ctx_;
    Eye::SampleEmitter sample_emitter_;
};

}  // namespace

std::unique_ptr<Replay> make_path_replay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer) {
    return std::make_unique<PathReplay>(scene, settings, tracer);
}

}  // namespace ambilux
