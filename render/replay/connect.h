// Connections of eye vertices with light vertices in a replay, as bidirectional methods make them.
#pragma once

#include "render/replay/eye.h"
#include "stages/connect_vertices.h"

namespace ambilux {

/// The eye vertex `z` of a sample, joined with light vertices. `scale`: beyond that of the render's own stage.
/// `lights`: the vertices of `source`, which know their light subpaths.
template <class Source, class Lights>
struct ReplayConnections {
    using Mis = typename Source::Mis;

    ReplayEye<Mis>& eye;
    const Vertex<Mis>& vertex;
    const Subpath<Mis>& path;
    const Lights& lights;
    Source source;
    WaveState state{};
    float scale = 1.0f;

    SubpathEnd<Mis> exact_end() const { return {vertex, path.throughput, path.depth}; }
    SubpathEnd<Mis> packed_end() const { return rounded_end<kReplayFeatures>(eye.ctx.view, vertex, path); }

    /// The vertices that a search of the render's stages finds.
    void searched() const {
        const auto search =
            source.search(eye.numbers.key, path.depth, vertex, eye.ctx.rules.max_depth, source.link(vertex, 0));
        uint32_t next = source.first(0), found = search.find(next);
        if (found == kNone) return;
        const SubpathEnd<Mis> end = packed_end();
        for (; found != kNone; found = search.find(next)) pair(search.draw(found), end, found);
    }
    void all_backwards(const SubpathEnd<Mis>& end) const {
        for (uint32_t i = source.vertices.counter->size(); i-- > 0;)
            if (path.depth + source.vertices.items.load_front(i).bits.depth() + 1 <= eye.ctx.rules.max_depth)
                pair(source, end, i);
    }
    void all_forwards(const SubpathEnd<Mis>& end) const {
        for (uint32_t i = 0; i < source.vertices.counter->size(); ++i) pair(source, end, i);
    }

private:
    template <class Draw>
    void pair(const Draw& draw, const SubpathEnd<Mis>& end, uint32_t place) const {
        const auto& ctx = eye.ctx;
        const ConnectionVertex<Mis> light = load_vertex<kReplayFeatures>(source.vertices, place);
        CandidateItem item;
        bool pushed = false;
        DropWatch watch;
        ReplayDrop drop;
        push_connection<kReplayFeatures>(ctx.view, ctx.rules, draw, state, eye.numbers, end, 0, light, place, true,
                                         LastItem<CandidateItem>{&item, &pushed}, watch.record());
        const bool dropped = watch.dropped("connect_vertices", drop);
        if (!pushed && !dropped) return;
        ReplayCandidate& r = eye.add("connection");
        r.light_depth = light.bits().depth();
        lights.name_owner(place, r);
        if (eye.details) r.densities = connection_densities(end, unpack_end<kReplayFeatures>(ctx.view, light));
        if (pushed) {
            item.value *= scale;
            return eye.arrival.light(item, r);
        }
        r.strategy = Strategy::make(r.light_depth + 1, end.depth + 1);
        r.fate = ReplayFate::invalid;
        r.drop = drop;
    }
};

}  // namespace ambilux
