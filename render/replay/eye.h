// The eye subpath of a sample again, and all that it finds.
#pragma once

#include <functional>

#include "render/replay/arrival.h"
#include "render/replay/describe.h"
#include "stages/eye_vertex.h"
#include "transport/subpath/start.h"

namespace ambilux {

template <class Mis>
struct ReplayEye;

/// How an eye subpath is joined with light subpaths; what a method does not do is empty.
template <class Mis>
struct ReplayJoins {
    std::function<void(ReplayEye<Mis>&, const Vertex<Mis>&, const Subpath<Mis>&)> connect;
    std::function<void(ReplayEye<Mis>&)> merge;  ///< where its ray ended
    std::function<void(Subpath<Mis>&)> start;    ///< what else its first ray knows
};

/// One eye subpath on its way.
template <class Mis>
struct ReplayEye {
    /// The stage that samples emitters; false if it pushed no candidate.
    using SampleEmitter = std::function<bool(const ReplayContext<Mis>&, const Vertex<Mis>&, const Subpath<Mis>&,
                                             const RandomNumbers&, StageRecord*, CandidateItem&)>;

    const ReplayContext<Mis>& ctx;
    const SampleEmitter& sample_emitter;
    const ReplayJoins<Mis>& joins;
    bool details;
    RandomNumbers numbers;
    ReplaySample& out;
    EyeArrival<Mis> arrival;
    Subpath<Mis> ray{};  ///< that ended at `hit`
    Hit hit{};

    /// Emission that the ray met.
    void found(const Candidate<Mis>& c) {
        ReplayCandidate& r = add(hit.prim == kNone ? "environment" : "hit");
        if (details) r.densities = hit_densities(ctx, ray, hit);
        arrival.emission(c, r);
    }
    void next_event(const Vertex<Mis>& z, const Subpath<Mis>& path) {
        CandidateItem item;
        DropWatch watch;
        ReplayDrop drop;
        const bool pushed = sample_emitter(ctx, z, path, numbers, watch.record(), item);
        const bool dropped = watch.dropped("connect", drop);
        if (!pushed && !dropped) return;
        ReplayCandidate& r = add("next event");
        if (details) r.densities = next_event_densities(ctx, z, numbers.next_event(path.depth));
        if (pushed) return arrival.light(item, r);
        r.strategy = Strategy::make(1, path.depth + 1);
        r.fate = ReplayFate::invalid;
        r.drop = drop;
    }
    ReplayCandidate& add(const char* kind) {
        out.candidates.emplace_back();
        out.candidates.back().kind = kind;
        out.candidates.back().eye_depth = ray.depth;
        return out.candidates.back();
    }
};

template <class Mis>
struct ReplayEyeSink {
    ReplayEye<Mis>& eye;

    RandomNumbers numbers() const { return eye.numbers; }
    void arrived(const Subpath<Mis>& path, const Hit& hit) const {
        eye.ray = path;
        eye.hit = hit;
        if (eye.joins.merge) eye.joins.merge(eye);
    }
    void add(const Candidate<Mis>& c) const { eye.found(c); }
    void at(const Vertex<Mis>& z, const Subpath<Mis>& path, const RandomNumbers&) const {
        eye.next_event(z, path);
        if (eye.joins.connect) eye.joins.connect(eye, z, path);
    }
    bool valid(Rgb throughput) const {
        DropWatch watch;
        if (is_valid_radiance(throughput, watch.record())) return true;
        watch.dropped("shade", eye.out.eye.drop);
        return false;
    }
};

/// Next event estimation of a render: NextEvent, or what a variant has in its place.
template <class Mis, class Stage>
bool push_next_event(const ReplayContext<Mis>& ctx, const Stage& stage, const Vertex<Mis>& z, const Subpath<Mis>& path,
                     const RandomNumbers& numbers) {
    stage.at(ctx.view, ctx.rules, z, path, 0, numbers);
    return *stage.candidates.pushed;
}
template <class Mis>
bool sample_next_event(const ReplayContext<Mis>& ctx, const Vertex<Mis>& z, const Subpath<Mis>& path,
                       const RandomNumbers& numbers, StageRecord* record, CandidateItem& item) {
    bool pushed = false;
    const NextEvent<kReplayFeatures, Mis, LastItem<CandidateItem>> stage = {{&item, &pushed}, record, true};
    return push_next_event(ctx, stage, z, path, numbers);
}

/// The eye subpath of `out`'s pixel and sample; what it brings is in out.eye_sum.
template <class Mis>
void replay_eye(const ReplayContext<Mis>& ctx, const typename ReplayEye<Mis>::SampleEmitter& sample_emitter,
                const ReplayJoins<Mis>& joins, bool details, ReplaySample& out) {
    if (ctx.rules.max_depth == 0) return;
    const uint32_t pixel = out.y * ctx.view.sensor.crop_width + out.x;
    out.eye.side = Side::eye;
    out.eye.number = pixel;
    const RandomNumbers numbers = {{out.seed, pixel, out.sample, Stream::eye}};
    ReplayEye<Mis> eye{ctx, sample_emitter, joins, details, numbers, out, EyeArrival<Mis>(ctx)};
    float tmax;
    auto first = start_eye_subpath<kReplayFeatures>(ctx.view, ctx.rules.mis, out.x, out.y, numbers, tmax);
    if (joins.start) joins.start(first);
    replay_subpath(ctx, ctx.rules.longest(Side::eye), first, tmax, ReplayEyeSink<Mis>{eye}, details, out.eye);
    out.eye_sum = eye.arrival.sum();
}

}  // namespace ambilux
