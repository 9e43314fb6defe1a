// What becomes of light that was found: the stages of a render, one candidate at a time, each with a record of its own.
#pragma once

#include "items/candidate_items.h"
#include "render/replay/context.h"
#include "render/replay/record.h"
#include "stages/arrival.h"
#include "stages/splat.h"

namespace ambilux {

/// Keeps the last item that a stage pushed.
template <class Item>
struct LastItem {
    using value_type = Item;
    Item* item;
    bool* pushed;

    uint32_t push(const Item& i) const {
        *item = i;
        *pushed = true;
        return 0;
    }
};

/// The sample of an eye subpath, and how light comes to it: mis_weight, occlude, accumulate.
template <class Mis>
class EyeArrival {
public:
    explicit EyeArrival(const ReplayContext<Mis>& ctx) : ctx_(ctx) {}

    Rgb sum() const { return start_of<Rgb>(sample_); }

    /// s = 0, which the vertex stage found.
    void emission(const Candidate<Mis>& c, ReplayCandidate& out) {
        fill(c.value, c.ratio, c.strategy, out);
        if (!made(c.value, "shade", out)) return;
        Contribution kept{};
        bool pushed = false;
        WeighEmission<LastItem<Contribution>>{{}, {&kept, &pushed}, watch_.record(), {}}.push(
            EmissionItem{c.value, 0, c.ratio, c.strategy, {}});
        if (watch_.dropped("mis_weight", out.drop)) return void(out.fate = ReplayFate::invalid);
        if (pushed) arrive(kept, out);
    }

    /// Next event estimation and connections.
    void light(CandidateItem c, ReplayCandidate& out) {
        fill(c.value, c.ratio, c.strategy, out);
        out.origin = c.origin;
        out.direction = c.direction;
        out.tmax = fabsf(c.tmax);
        if (ctx_.radiance_first && c.tmax == kTowardsEnvironment) {
            c.value *= environment_radiance<kReplayFeatures>(ctx_.view, c.direction);
            c.tmax = kInfinity;
            if (!made(c.value, "connect", out)) return;
        }
        ShadowItem shadow;
        c.path = 0;
        const WeighCandidates<LastItem<ShadowItem>> weigh = {{}, {}, watch_.record(), {}, &sample_, ctx_.cull};
        const bool left = weigh.weigh(c, shadow);
        if (watch_.dropped("mis_weight", out.drop)) return void(out.fate = ReplayFate::invalid);
        if (!left) return void(out.fate = is_zero(c.value * out.weight) ? ReplayFate::zero : ReplayFate::culled);
        occlude(shadow, out);
    }

    /// What all merges of a vertex bring together; false if it is dropped.
    bool merged(Rgb light, ReplayDrop& drop) {
        Accumulate{{}, &sample_, watch_.record(), {}, {}}.push(Contribution{light, 0});
        return !watch_.dropped(Accumulate::kName, drop);
    }

private:
    static void fill(Rgb value, float ratio, Strategy strategy, ReplayCandidate& out) {
        out.value = value;
        out.ratio = ratio;
        out.weight = mis_weight(ratio);
        out.strategy = strategy;
    }
    bool made(Rgb value, const char* stage, ReplayCandidate& out) {
        if (is_valid_radiance(value, watch_.record())) return true;
        watch_.dropped(stage, out.drop);
        out.fate = ReplayFate::invalid;
        return false;
    }
    void occlude(const ShadowItem& shadow, ReplayCandidate& out) {
        Contribution kept{};
        bool pushed = false;
        const Occlude<kReplayFeatures, HostTracer, LastItem<Contribution>> stage = {
            ctx_.view, ctx_.tracer, {}, {&kept, &pushed}, watch_.record(), {}};
        stage.process(shadow);
        if (watch_.dropped("occlude", out.drop)) return void(out.fate = ReplayFate::invalid);
        if (!pushed) return void(out.fate = ReplayFate::blocked);
        arrive(kept, out);
    }
    void arrive(Contribution c, ReplayCandidate& out) {
        c.path = 0;
        out.contribution = c.value;
        Accumulate{{}, &sample_, watch_.record(), {}, {}}.push(c);
        out.fate = watch_.dropped("accumulate", out.drop) ? ReplayFate::invalid : ReplayFate::arrived;
    }

    const ReplayContext<Mis>& ctx_;
    DropWatch watch_;
    Lane sample_{};
};

/// A splat candidate: mis_weight and occlude. `out` has its value on the film where the filter is 1.
template <class Mis>
void splat_arrival(const ReplayContext<Mis>& ctx, const CandidateItem& c, ReplayCandidate& out) {
    out.value = c.value;
    out.ratio = c.ratio;
    out.weight = mis_weight(c.ratio);
    out.strategy = c.strategy;
    out.origin = c.origin;
    out.direction = c.direction;
    out.tmax = c.tmax;
    out.film = c.film;
    DropWatch watch;
    CandidateItem weighted;
    bool pushed = false;
    WeighSplats<LastItem<CandidateItem>>{{}, {&weighted, &pushed}, watch.record()}.push(c);
    if (watch.dropped("mis_weight", out.drop)) return void(out.fate = ReplayFate::invalid);
    if (!pushed) return;
    if (!is_valid_ray(c.origin, c.direction, watch.record())) {
        watch.dropped("occlude", out.drop);
        return void(out.fate = ReplayFate::invalid);
    }
    const Ray ray = {c.origin, c.tmax, c.direction, c.opacity_seed};
    const bool blocked = ctx.tracer.template occluded<kReplayFeatures>(ctx.view, ray);
    out.fate = blocked ? ReplayFate::blocked : ReplayFate::arrived;
    if (!blocked) out.contribution = weighted.value;
}

}  // namespace ambilux
