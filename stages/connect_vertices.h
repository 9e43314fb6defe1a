// connect_vertices: eye vertices and light vertices (s, t >= 2).
#pragma once

#include "stages/arrival.h"
#include "stages/connection_loop.h"
#include "stages/eye_vertex.h"
#include "stages/fused_clock.h"
#include "stages/light_vertex_search.h"
#include "transport/subpath/connection.h"

namespace ambilux {

/// The eye end `z` of `slot` and light vertex `light`, which lies at `place`. `Out` takes candidates. The scale of the
/// `Draw` is asked for last: until then no register keeps it.
template <Features F, class Mis, class Draw, class Out>
AMBILUX_HD_ONCE void push_connection(const SceneView& scene, const Rules<Mis>& rules, const Draw& draw,
                                     const WaveState& state, const NumbersOf<Mis>& numbers, const SubpathEnd<Mis>& z,
                                     uint32_t slot, const ConnectionVertex<Mis>& light, uint32_t place, bool seeds,
                                     const Out& candidates, StageRecord* record) {
    const SubpathEnd<Mis> y = unpack_end<F>(scene, light);
    Candidate<Mis> c;
    if (!connection<F>(rules, z, y, c)) return;
    const auto note = draw.note(c, z.throughput, state);
    c.value *= draw.scale(state);
    if (!is_valid_radiance(c.value, record)) return;
    const uint32_t which = connection_ray(z.depth, draw.from_cache() ? kMaxDepth + place : y.depth);
    candidates.push(noted(pack_candidate(c, slot, seeds ? numbers.shadow_seed(which) : 0), note));
}

/// At an eye vertex: next event estimation, and the first pair for connect_vertices.
template <Features F, class Out, class Source>
struct NextEventAndPair {
    using Mis = typename Source::Mis;

    NextEvent<F, Mis, Out> next_event;
    Source source;
    Queue<ConnectionVertex<Mis>> eye_vertices;
    Queue<PairItem> pairs;

    AMBILUX_HD void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>& numbers) const {
        next_event.at(scene, rules, v, path, slot, numbers);
        if (!rules.connect) return;
        const Warp warp;
        uint32_t next = source.first(slot);
        const uint32_t link = source.link(v, slot),
                       light = source.search(numbers.key, path.depth, v, rules.max_depth, link).find(next);
        if (light != kNone)
            pairs.push({push_vertex<F>(eye_vertices, pack_connection_vertex(v, path, link)), light, slot, next});
        warp.meet();  // else lanes that search longer than others stay apart
    }
};

/// At an eye vertex of a host: next event estimation and all pairs, in the same order and of the same vertices.
template <Features F, class Out, class Source>
struct NextEventAndConnections {
    using Mis = typename Source::Mis;

    Clocked<NextEvent<F, Mis, Out>> next_event;
    Source source;
    const WaveState* state;
    StageRecord* record;  ///< of connect_vertices

    AMBILUX_HD void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>& numbers) const {
        if (rules.next_event) next_event.at(scene, rules, v, path, slot, numbers);
        if (rules.connect) connect(scene, rules, v, path, slot, numbers);
    }
    AMBILUX_HD void connect(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v,
                            const Subpath<Mis>& path, uint32_t slot, const NumbersOf<Mis>& numbers) const {
        const FusedClock clock(record, true);
        const auto lights = source.search(numbers.key, path.depth, v, rules.max_depth, source.link(v, slot));
        uint32_t next = source.first(slot), found = lights.find(next);
        if (found == kNone) return;
        const SubpathEnd<Mis> end = rounded_end<F>(scene, v, path);
        for (; found != kNone; found = lights.find(next)) {
            record->count_item(path.depth);
            push_connection<F>(scene, rules, lights.draw(found), *state, numbers, end, slot,
                               load_vertex<F>(source.vertices, found), found, next_event.inner.seeds,
                               next_event.inner.candidates, record);
        }
    }
};

/// The pairs of an eye vertex one after the other. Pairs for whose candidates there is no capacity are deferred.
template <Features F, class Out, class Source>
struct ConnectVertices {
    static constexpr const char* kName = "connect_vertices";
    using Mis = typename Source::Mis;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<PairItem> pairs, deferred;
    Queue<ConnectionVertex<Mis>> vertices;
    Source source;
    Out candidates;
    uint32_t candidate_capacity;
    const QueueCounter* candidate_counter;
    StageRecord* record;
    bool seeds;                      ///< NextEvent
    bool one_connection_per_launch;  ///< else sums of a path depend on the order of threads

    const Queue<PairItem>& items() const { return pairs; }

    /// The next pair of a vertex, and the slot where the last candidate, or its shadow ray, went.
    struct Loop {
        PairItem pair;
        uint32_t slot;
    };

    AMBILUX_HD Loop begin(uint32_t i) const { return {pairs.load(i), 0}; }
    AMBILUX_HD bool step(Loop& loop, LoopCount& count) const { return step(loop.pair, count, Sink{candidates, loop}); }
    AMBILUX_HD uint32_t slot(const Loop& loop) const { return loop.slot; }
    AMBILUX_HD bool one_step() const { return one_connection_per_launch; }
    AMBILUX_HD uint32_t capacity() const { return one_connection_per_launch ? ~0u : candidate_capacity; }
    AMBILUX_HD void defer(const Loop& loop, LoopCount& count) const {
        deferred.push(loop.pair);
        --count.steps;
    }
    AMBILUX_HD void add(const LoopCount& count) const { record->count_items(count.steps, wave.state->depth); }

    /// As much of a loop as there is capacity for, on a host.
    AMBILUX_HD void operator()(uint32_t i) const {
        LoopCount count = {};
        Loop loop = begin(i);
        bool goes_on = true;
        while (goes_on && candidate_counter->count < capacity()) {
            goes_on = step(loop, count);
            if (one_connection_per_launch) break;
        }
        if (goes_on) defer(loop, count);
        add(count);
    }

    /// The pair in hand, whose candidate goes to `out`. False if there is no other after it.
    template <class Sink>
    AMBILUX_HD bool step(PairItem& pair, LoopCount& count, const Sink& out) const {
        const uint32_t place = pair.light;
        // Before anything waits for the eye vertex.
        const ConnectionVertex<Mis> light = load_vertex<F>(source.vertices, place);
        const ConnectionVertex<Mis> eye = load_vertex<F>(vertices, pair.vertex);
        const SubpathEnd<Mis> z = unpack_end<F>(scene, eye);
        const NumbersOf<Mis> numbers = eye_numbers(rules.mis, wave, pair.path);
        const Warp warp;
        const auto search = source.search(numbers.key, z.depth, z.vertex, rules.max_depth, eye.front.link);
        pair.light = search.find(pair.next);
        warp.meet();  // else lanes that search longer than others stay apart
        push_connection<F>(scene, rules, search.draw(place), *wave.state, numbers, z, pair.path, light, place, seeds,
                           out, record);
        if (pair.light == kNone) return false;
        ++count.steps;
        return true;
    }

private:
    struct Sink {
        const Out& candidates;
        Loop& loop;

        template <class Item>
        AMBILUX_HD void push(const Item& c) const {
            loop.slot = candidates.push(c);
        }
    };
};

/// connect_vertices and occlude as one stage: for structures so small that tracing a shadow ray takes less than the
/// memory that it would go through. A thread adds what all pairs of a vertex bring to the sample of its path at once.
template <Features F, class Tracer, class Shadows, class Source>
struct ConnectAndOcclude {
    static constexpr const char* kName = "connect_vertices";

    ConnectVertices<F, WeighCandidates<Shadows>, Source> connect;
    Occlude<F, Tracer, Accumulate> occlude;
    StageRecord* record;

    const Queue<PairItem>& items() const { return connect.pairs; }

    struct Loop {
        PairItem pair;
        Rgb sum;  ///< of the light that pairs have brought
    };

    AMBILUX_HD Loop begin(uint32_t i) const { return {connect.pairs.load(i), {0.0f, 0.0f, 0.0f}}; }
    AMBILUX_HD bool step(Loop& loop, LoopCount& count) const {
        const bool goes_on = connect.step(loop.pair, count, Sink{*this, loop, count});
        if (!goes_on && !is_zero(loop.sum)) occlude.contributions.push({loop.sum, loop.pair.path});
        return goes_on;
    }
    AMBILUX_HD uint32_t slot(const Loop&) const { return 0; }
    AMBILUX_HD uint32_t capacity() const { return ~0u; }
    AMBILUX_HD bool one_step() const { return false; }
    AMBILUX_HD void defer(const Loop&, LoopCount&) const {}
    AMBILUX_HD void add(const LoopCount& count) const {
        connect.add(count);
        occlude.record->count_items(count.rays, connect.wave.state->depth);
    }

private:
    struct Sink {
        const ConnectAndOcclude& stage;
        Loop& loop;
        LoopCount& count;

        AMBILUX_HD void push(const CandidateItem& c) const {
            ShadowItem item;
            if (!stage.connect.candidates.weigh(c, item)) return;
            ++count.rays;
            if (stage.occlude.is_free(item)) loop.sum += item.value;
        }
    };
};

}  // namespace ambilux
