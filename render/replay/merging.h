// The light vertices of an iteration of a method that merges, by its own stages, and the merges of an eye subpath.
#pragma once

#include "backends/cpu/host_memory.h"
#include "backends/cpu/whole_executor.h"
#include "integrators/bdpt/vcm/merge.h"
#include "integrators/bdpt/vcm/merging_directions.h"
#include "integrators/bdpt/vcm/source.h"
#include "render/replay/eye.h"
#include "render/replay/light.h"

namespace ambilux {

inline std::vector<ReplayNumber> named_sums(const MergingSums& s) {
    return {{"dvcm", s.dvcm}, {"dvc", s.dvc}, {"dvm", s.dvm}, {"merge_area", s.area}};
}

/// A vertex that a light subpath leaves.
struct KeptVertex {
    MergeVertex merge;
    ConnectionVertex<MergingMis> connection;
    uint64_t key;
};

/// A queue of one item.
template <class Item>
struct ReplayItem {
    Lane lanes[LaneArray<Item>::kLanes] = {};
    QueueCounter counter = {};

    ReplayItem() { counter.capacity = 1; }
    ReplayItem(const ReplayItem&) = delete;
    Queue<Item> queue() { return {{lanes, 1}, &counter}; }
};

using MergingHit = HitItem<SubpathItems<MergingMis>::Ray>;
inline MergingHit merging_hit(Side side, uint32_t slot, const Subpath<MergingMis>& path, const Hit& hit) {
    return {SubpathItems<MergingMis>::pack(path, side, slot, kInfinity), hit.u, hit.v, hit.prim, 0};
}

/// What stage keep_vertices keeps of a light subpath that starts in `slot` of the first tile of `wave`.
inline void keep_light_subpath(const ReplayContext<MergingMis>& ctx, const VcmPolicy& policy, const Wave& wave,
                               uint32_t slot, ReplayLightRequest<MergingMis> request, std::vector<KeptVertex>& kept) {
    ReplayItem<MergingHit> hit;
    ReplayItem<MergeVertex> merge;
    ReplayItem<ConnectionVertex<MergingMis>> connection;
    uint64_t key = 0;
    const KeepVertices<kReplayFeatures> keep = {ctx.view,
                                                wave,
                                                ctx.rules,
                                                hit.queue(),
                                                {merge.queue(), connection.queue().items, &key},
                                                ctx.rules.mis.now,
                                                policy.numbers(),
                                                policy.keys,
                                                policy.rules.connect,
                                                policy.keeps_first(),
                                                nullptr};
    request.details = request.splats = false;
    request.arrived = [&](const Subpath<MergingMis>& path, const Hit& end) {
        hit.queue().store(0, merging_hit(Side::light, slot, path, end));
        keep(0);
        if (merge.counter.count > 0) kept.push_back({merge.queue().load(0), connection.queue().load(0), key});
        merge.counter.count = 0;
    };
    replay_light(ctx, request);
}

/// All that the light subpaths of an iteration leave, in the order of their keys.
class ReplayIteration {
public:
    /// `subpaths`: numbers of a sample.
    ReplayIteration(VcmPolicy policy, uint32_t first_sample, uint32_t subpaths,
                    std::vector<std::vector<KeptVertex>> kept)
        : first_sample_(first_sample), subpaths_(subpaths), samples_(policy.vcm.samples) {
        policy.waves.iterations_together = 1;
        wave_.iteration = first_sample / policy.vcm.samples;
        wave_.samples = policy.vcm.samples;
        uint64_t count = 0;
        for (const auto& part : kept) count += part.size();
        const StateSize size = {uint32_t(count), host_primitive_bytes()};
        Layout plan;
        (void)VcmState::lay_out(plan, policy, size);
        memory_ = HostMemory(plan.bytes());
        Layout layout(plan, memory_.data());
        state_ = VcmState::lay_out(layout, policy, size);
        state_.all.merges.counter->count = state_.all.merges.counter->capacity = size.appended;
        source_ = VcmSource::of(state_, &wave_, policy);
        uint32_t place = 0;
        for (auto& part : kept) {
            for (const KeptVertex& v : part) put(place++, v);
            std::vector<KeptVertex>().swap(part);
        }
        CpuWholeExecutor exec;
        StageRecord record{};
        exec.sort_pairs(state_.order, size.appended, state_.key_bits(), &record);
        exec.for_each(FindCells{state_, &wave_, samples_, &record}, size.appended + 1);
        exec.for_each(PlaceVertices{state_, &record}, size.appended);
    }
    ReplayIteration(const ReplayIteration&) = delete;

    const VcmState& state() const { return state_; }
    const VcmSource& source() const { return source_; }
    uint32_t size() const { return state_.all.merges.counter->count; }
    void name_owner(uint32_t place, ReplayCandidate& c) const {
        const uint32_t subpath = state_.keys.subpath(state_.order.keys[1][place]);
        c.light_subpath = subpath % subpaths_;
        if (samples_ > 1) c.light_sample = first_sample_ + subpath / subpaths_;
    }

private:
    void put(uint32_t place, const KeptVertex& v) {
        state_.all.merges.store(place, v.merge);
        state_.order.keys[0][place] = v.key;
        state_.order.values[0][place] = place;
        if (state_.all.connections.capacity > 0) state_.all.connections.store(place, v.connection, state_.lanes);
    }

    uint32_t first_sample_, subpaths_, samples_;
    HostMemory memory_;
    VcmState state_;
    WaveState wave_{};  ///< of the iteration
    VcmSource source_;
};

/// Of eye vertex `z` and light vertex `y`.
inline std::vector<ReplayNumber> merge_densities(const ReplayContext<MergingMis>& ctx, const Vertex<MergingMis>& z,
                                                 const MergeVertex& y) {
    const BsdfValue f =
        ctx.rules.directions.evaluate<kReplayFeatures>(z, -octahedral_decode(y.d), TransportMode::radiance);
    return {{"distance_over_radius", length(y.front.p - z.point.p) / ctx.rules.mis.radius(z.sums)},
            {"pdf_eye_sa", f.pdf_sa},
            {"pdf_eye_reverse_sa", f.pdf_reverse_sa}};
}

/// The merges where the ray of an eye subpath ended. They are added to the sample together, as stage merge does.
inline void replay_merges(ReplayEye<MergingMis>& eye, const ReplayIteration& lights) {
    const auto& ctx = eye.ctx;
    const auto merge = [&](const Subpath<MergingMis>& path, const Vertex<MergingMis>& z) {
        if (path.depth == 1 && !ctx.rules.mis.merges_first) return;
        const size_t before = eye.out.candidates.size();
        MergeSum<kReplayFeatures> sum = {ctx.view, ctx.rules, z, path};
        NearVertices near = {lights.state(), MergeGrid::of(ctx.view, ctx.rules.mis.now->radius), 0, z.point.p,
                             ctx.rules.mis.radius(z.sums)};
        for (uint32_t k; (k = near.next()) != kNone;) {
            const MergeVertex y = lights.state().sorted.load(k);
            MergeFound found;
            if (!sum.find(y, found)) continue;
            sum.add(found);
            ReplayCandidate& r = eye.add("merge");
            r.merged = true;
            r.strategy = Strategy::make(y.front.depth + 1, path.depth + 1);
            r.light_depth = y.front.depth;
            lights.name_owner(k, r);
            r.eye_p = z.point.p;
            r.light_p = y.front.p;
            r.ratio = found.ratio;
            r.weight = mis_weight(found.ratio);
            r.value = sum.light(found.times(1.0f));
            r.contribution = sum.light(found.times(r.weight));
            r.fate = is_zero(r.contribution) ? ReplayFate::zero : ReplayFate::arrived;
            if (eye.details) r.densities = merge_densities(ctx, z, y);
        }
        const Rgb light = sum.light(sum.sum);
        ReplayDrop drop;
        if (is_zero(light) || eye.arrival.merged(light, drop)) return;
        for (size_t i = before; i < eye.out.candidates.size(); ++i) {
            eye.out.candidates[i].fate = ReplayFate::invalid;
            eye.out.candidates[i].drop = drop;
        }
    };
    at_mergeable<kReplayFeatures>(ctx.view, ctx.rules, Side::eye, merging_hit(Side::eye, 0, eye.ray, eye.hit), merge);
}

}  // namespace ambilux
