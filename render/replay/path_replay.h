// Replays of methods without light subpaths.
#pragma once

#include <fmt/format.h>

#include "core/error.h"
#include "integrators/registry.h"
#include "render/replay/eye.h"
#include "render/replay/make.h"

namespace ambilux {

template <class Integrator>
class PathReplay final : public Replay {
public:
    using Policy = typename Integrator::Policy;

    PathReplay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer, const Policy& policy)
        : seed_(settings.seed), integrator_(settings.integrator),
          ctx_{scene.view(), tracer, policy.rules, policy.waves.cull, false}, sample_emitter_(sampling(policy)) {}

    ReplaySample sample(const ReplayRequest& request) const override {
        ReplaySample out = blank_sample(request, seed_);
        replay_eye<UnidirectionalMis>(ctx_, sample_emitter_, {}, request.details, out);
        finish(out);
        return out;
    }
    ReplaySubpath light_subpath(uint32_t, uint32_t, bool, std::vector<ReplayCandidate>&) const override {
        const auto have = [](const VariantTraits& v) {
            return v.light_subpaths && v.replay != ReplayPairing::no_replay;
        };
        throw Error(ExitCode::usage, fmt::format("--light-subpath: integrator {} has no light subpaths; {} have",
                                                 integrator_, listed(integrators_that(have))));
    }

private:
    using SampleEmitter = ReplayEye<UnidirectionalMis>::SampleEmitter;

    /// The stage that the integrator has in the place of next event estimation.
    static SampleEmitter sampling(const Policy& policy) {
        return [policy](const ReplayContext<UnidirectionalMis>& ctx, const Vertex<UnidirectionalMis>& z,
                        const Subpath<UnidirectionalMis>& path, const RandomNumbers& numbers, StageRecord* record,
                        CandidateItem& item) {
            bool pushed = false;
            const LastItem<CandidateItem> out = {&item, &pushed};
            using Stage = typename Integrator::template SampleEmitters<LastItem<CandidateItem>>;
            if constexpr (std::is_empty_v<decltype(policy.sampling)>)
                return push_next_event(ctx, Stage{out, record, true}, z, path, numbers);
            else
                return push_next_event(ctx, Stage{out, record, true, policy.sampling}, z, path, numbers);
        };
    }

    uint64_t seed_;
    std::string integrator_;
    ReplayContext<UnidirectionalMis> ctx_;
    SampleEmitter sample_emitter_;
};

}  // namespace ambilux
