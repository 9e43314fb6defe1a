// connect_vertices of bidirectional path tracing: eye vertices and light vertices (s, t >= 2).
#pragma once

#include "core/warp.h"
#include "items/vertex_items.h"
#include "stages/bidirectional_policy.h"
#include "stages/chain.h"
#include "stages/mis_weight.h"
#include "stages/occlude.h"
#include "stages/stage.h"

namespace ambilux {

/// Which of `size` light vertices the draw of an eye vertex finds, whose walk has the random numbers `key`: each with
/// the same probability. On a device threads of a warp that draw together find vertices that lie together, from a
/// random place of the cache on: so does what they load, and mostly it was left by walks on one material.
AMBILUX_HD uint32_t drawn_vertex(const RngKey& key, uint32_t depth, uint32_t draw, uint32_t size) {
    const uint32_t block = cache_block(depth, draw);
#if defined(__CUDA_ARCH__)
    const uint32_t together = __activemask(), rank = lane_rank(together);
    const int first = __ffs(int(together)) - 1;
    const RngKey shared = {key.seed, __shfl_sync(together, key.index, first), __shfl_sync(together, key.sample, first),
                           key.stream};
    const uint32_t at = mul_hi(random_bits(shared, __shfl_sync(together, block, first)).x, size) + rank;
    return at < size ? at : at % size;
#else
    return mul_hi(random_bits(key, block).x, size);
#endif
}

/// Goes through the light vertices that an eye vertex may be connected with.
struct LightVertexSearch {
    const BidirectionalPolicy& policy;
    const LightVertices& light_vertices;
    const RngKey& key;  ///< of the eye walk
    uint32_t depth;     ///< of the eye vertex `z`
    const WalkVertex& z;

    /// The next one, kNone if there is none, from `next` on, which goes on: a vertex of the light walk of the same
    /// slot, or, over a cache, the number of draws that are left.
    AMBILUX_HD uint32_t find(uint32_t& next) const {
        const bool drawn = policy.cache_draws > 0;
        const uint32_t size = light_vertices.counter->size();
        if (size == 0 || depth + 2 > policy.max_depth) next = kNone;
        while (next != kNone) {
            uint32_t light = next;
            if (drawn) light = drawn_vertex(key, depth, --next, size);
            const ConnectionVertexFront y = light_vertices.load_front(light);
            if (!drawn)
                next = y.link;
            else if (next == 0)
                next = kNone;
            if (depth + y.bits.depth() + 1 <= policy.max_depth && may_connect(y, z)) return light;
        }
        return kNone;
    }
};

/// A vertex of the eye walk of `path`.
struct EyeVertex {
    WalkVertex vertex;
    Rgb throughput;
    uint32_t path, depth;
};

template <Features F>
AMBILUX_HD EyeVertex eye_vertex_of(const SceneView& scene, const ConnectionVertex& item) {
    return {unpack_vertex<F>(scene, item), item.throughput, item.path(), item.bits().depth()};
}

/// Candidate of the eye vertex `z` and light vertex `light`, worth `scale` times their product. `place`: of the light
/// vertex in its cache.
template <Features F, class Candidates>
AMBILUX_HD_ONCE void push_connection(const SceneView& scene, const BidirectionalPolicy& policy, const RngKey& key,
                                     const EyeVertex& z, const ConnectionVertex& light, float scale, uint32_t place,
                                     const Candidates& candidates, StageRecord* record) {
    const uint32_t light_depth = light.front.bits.depth();
    const Strategy strategy = Strategy::make(light_depth + 1, z.depth + 1);
    if (!policy.singles.has(strategy) || is_zero(light.throughput) || is_zero(z.throughput))
        return;  // black diffuse surfaces
    const WalkVertex y = unpack_vertex<F>(scene, light);
    WalkConnection c;
    if (!connect_vertices<F>(policy.mis, y, light.throughput, z.vertex, z.throughput, c)) return;
    c.value *= scale;
    if (!is_light(c.value, record) || is_zero(c.value)) return;
    uint32_t seed = 0;
    if (F.opacity || policy.cull > 0.0f) {
        const uint32_t which = policy.cache_draws > 0 ? WalkBits::kMaxDepth + place : light_depth;
        seed = alpha_seed(key, z.depth + (which << WalkBits::kDepthBits), true);
    }
    candidates.push({c.value, z.path, 1.0f, policy.others(c.others), seed, c.tmax, c.o, strategy, c.d, 0});
}

/// What a draw from a cache is worth: M vertices of N walks are in it, and k draws estimate the sum over a walk's
/// vertices by M / (N k) times theirs.
AMBILUX_HD float draw_scale(const Wave& wave, const BidirectionalPolicy& policy, const LightVertices& light_vertices) {
    return float(light_vertices.counter->size()) / (float(wave.state->light_walks) * float(policy.cache_draws));
}

/// connect_vertices: the pairs of an eye vertex one after the other, with vertices of the light walk of its slot, or
/// drawn from a cache of those of all light walks of the wave (Davidovic et al. 2014). Chains of pairs for whose shadow
/// rays there is no room go on in another launch.
template <Features F>
struct ConnectVertices {
    static constexpr uint32_t kBlocksPerSm = F.bsdfs == bit(BsdfType::diffuse) ? 7 : 4;

    SceneView scene;
    Wave wave;
    BidirectionalPolicy policy;
    Queue<PairItem> pairs, rest;
    Queue<ConnectionVertex> vertices;
    LightVertices light_vertices;
    ConnectOutlet candidates;
    StageRecord* record;

    /// The next pair of a vertex, and the place where the last candidate, or its shadow ray, went.
    struct Chain {
        PairItem pair;
        uint32_t place;
    };

    AMBILUX_HD Chain begin(uint32_t i) const { return {pairs.load(i), 0}; }
    /// False if there is no other pair after this.
    AMBILUX_HD bool step(Chain& chain, ChainCount& count) const {
        return step(chain.pair, count, Outlet{candidates, chain});
    }
    AMBILUX_HD uint32_t place(const Chain& chain) const { return chain.place; }
    AMBILUX_HD bool one_step() const { return policy.one_pair; }
    /// Places for candidates.
    AMBILUX_HD uint32_t room() const {
        return policy.one_pair      ? ~0u
               : candidates.through ? candidates.next.shadows.queue.capacity
                                    : candidates.queue.capacity;
    }
    AMBILUX_HD void put_back(const Chain& chain, ChainCount& count) const {
        rest.push(chain.pair);
        --count.steps;
    }
    AMBILUX_HD void add(const ChainCount& count) const { record->count_items(count.steps, wave.state->depth); }

    /// As much of a chain as there is room for, on a host.
    AMBILUX_HD void operator()(uint32_t i) const {
        ChainCount count = {};
        Chain chain = begin(i);
        const QueueCounter& taken =
            candidates.through ? *candidates.next.shadows.queue.counter : *candidates.queue.counter;
        bool goes_on = true;
        while (goes_on && taken.count < room()) {
            goes_on = step(chain, count);
            if (policy.one_pair) break;
        }
        if (goes_on) put_back(chain, count);
        add(count);
    }

    /// The pair in hand, whose candidate goes to `to`.
    template <class To>
    AMBILUX_HD bool step(PairItem& pair, ChainCount& count, const To& to) const {
        const uint32_t place = pair.light;
        const ConnectionVertex light =
            load_vertex<F>(light_vertices, place);  // before anything waits for the eye vertex
        const EyeVertex z = eye_vertex_of<F>(scene, load_vertex<F>(vertices, pair.vertex));
        const RngKey key = wave.key(pair.path);
        const Warp warp;
        pair.light = LightVertexSearch{policy, light_vertices, key, z.depth, z.vertex}.find(pair.next);
        warp.meet();  // else lanes that search longer than others stay apart
        push_connection<F>(scene, policy, key, z, light,
                           policy.cache_draws > 0 ? draw_scale(wave, policy, light_vertices) : 1.0f, place, to, record);
        if (pair.light == kNone) return false;
        ++count.steps;
        return true;
    }

private:
    struct Outlet {
        const ConnectOutlet& candidates;
        Chain& chain;

        AMBILUX_HD void push(const ConnectCandidate& c) const { chain.place = candidates.push(c); }
    };
};

/// connect_vertices and occlude as one stage: for structures so small that tracing a shadow ray takes less than the
/// memory that it would go through. A thread adds what all pairs of a vertex bring to the sample of its path at once.
template <Features F, class Tracer>
struct ConnectAndOcclude {
    static constexpr uint32_t kBlocksPerSm = 8;

    ConnectVertices<F> connect;
    Occlude<F, Tracer> occlude;

    struct Chain {
        PairItem pair;
        Rgb sum;  ///< of the light that pairs have brought
    };

    AMBILUX_HD Chain begin(uint32_t i) const { return {connect.pairs.load(i), {0.0f, 0.0f, 0.0f}}; }
    AMBILUX_HD bool step(Chain& chain, ChainCount& count) const {
        const bool goes_on = connect.step(chain.pair, count, Outlet{*this, chain, count});
        if (!goes_on && !is_zero(chain.sum)) occlude.contributions.push({chain.sum, chain.pair.path});
        return goes_on;
    }
    AMBILUX_HD uint32_t place(const Chain&) const { return 0; }
    AMBILUX_HD uint32_t room() const { return ~0u; }
    AMBILUX_HD bool one_step() const { return false; }
    AMBILUX_HD void put_back(const Chain&, ChainCount&) const {}
    AMBILUX_HD void add(const ChainCount& count) const {
        connect.add(count);
        occlude.record->count_items(count.rays, connect.wave.state->depth);
    }

private:
    struct Outlet {
        const ConnectAndOcclude& stage;
        Chain& chain;
        ChainCount& count;

        AMBILUX_HD void push(const ConnectCandidate& c) const {
            ShadowItem item;
            if (!stage.connect.candidates.next.weigh(c, item)) return;
            ++count.rays;
            if (stage.occlude.is_free(item)) chain.sum += item.value;
        }
    };
};

}  // namespace ambilux
