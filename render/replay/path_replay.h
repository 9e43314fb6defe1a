// Replays of methods without light subpaths.
#pragma once

#include <fmt/format.h>

#include "core/error.h"
#include "integrators/registry.h"
#include "render/replay/eye.h"
#include "render/replay/guide.h"
#include "render/replay/make.h"

namespace ambilux {

/// Whose stages render.
template <class Integrator>
struct StagesOf {
    using Type = Integrator;
};
template <class Integrator>
    requires requires { typename Integrator::Unguided; }
struct StagesOf<Integrator> {
    using Type = typename Integrator::Unguided;
};

template <class Integrator>
class PathReplay final : public Replay {
public:
    using Policy = typename Integrator::Policy;
    using Mis = decltype(Policy::rules.mis);

    PathReplay(const Scene& scene, const RenderSettings& settings, const HostTracer& tracer, const Policy& policy)
        : seed_(settings.seed), integrator_(settings.integrator),
          ctx_{scene.view(), tracer, policy.rules, policy.waves.cull, false}, sample_emitter_(sampling(policy)) {
        if constexpr (kGuided) guide_.emplace(scene, settings, GuidePolicy{policy.guided, policy.training});
    }

    ReplaySample sample(const ReplayRequest& request) const override {
        ReplaySample out = blank_sample(request, seed_);
        if constexpr (kGuided) {
            const auto ctx = guided_context(ctx_, *guide_, request.sample);
            const ReplayJoins<Mis> joins = {{}, {}, guided_start(ctx_, *guide_, request)};
            replay_eye<Mis>(*ctx, sample_emitter_, joins, request.details, out);
        } else {
            replay_eye<Mis>(ctx_, sample_emitter_, {}, request.details, out);
        }
        finish(out);
        return out;
    }
    uint32_t iteration_samples() const override { return guide_ ? guide_->iteration_samples() : 1; }
    std::shared_ptr<const KeptGuide> guide(uint32_t sample) const override {
        return guide_ ? guide_->at(sample) : nullptr;
    }
    ReplaySubpath light_subpath(uint32_t, uint32_t, bool, std::vector<ReplayCandidate>&) const override {
        const auto have = [](const VariantTraits& v) {
            return v.light_subpaths && v.replay != ReplayPairing::no_replay;
        };
        throw Error(ExitCode::usage, fmt::format("--light-subpath: integrator {} has no light subpaths; {} have",
                                                 integrator_, listed(integrators_that(have))));
    }

private:
    static constexpr bool kGuided = requires(const Policy& p) { p.guided; };
    using SampleEmitter = ReplayEye<Mis>::SampleEmitter;

    /// The stage that the integrator has in the place of next event estimation.
    static SampleEmitter sampling(const Policy& policy) {
        return [policy](const ReplayContext<Mis>& ctx, const Vertex<Mis>& z, const Subpath<Mis>& path,
                        const RandomNumbers& numbers, StageRecord* record, CandidateItem& item) {
            bool pushed = false;
            const LastItem<CandidateItem> out = {&item, &pushed};
            using Stage = typename StagesOf<Integrator>::Type::template SampleEmitters<LastItem<CandidateItem>>;
            if constexpr (std::is_empty_v<decltype(policy.sampling)>)
                return push_next_event(ctx, Stage{out, record, true}, z, path, numbers);
            else
                return push_next_event(ctx, Stage{out, record, true, policy.sampling}, z, path, numbers);
        };
    }

    uint64_t seed_;
    std::string integrator_;
    ReplayContext<Mis> ctx_;
    SampleEmitter sample_emitter_;
    std::optional<ReplayedGuide> guide_;
};

}  // namespace ambilux
