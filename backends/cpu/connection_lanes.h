// Connections of plain eye vertices in lanes: pairs with plain light vertices that face them are gathered, computed
// side by side and pushed in their order; others go one by one.
#pragma once

#include "backends/cpu/plain_vertices.h"
#include "stages/connect_vertices.h"
#include "stages/subpath_numbers.h"

namespace ambilux {

/// Runs EyeVertex with NextEventAndConnections for items one after the other: add() them, and then run().
template <Features F, class EmissionOut, class Out>
class ConnectionLanes {
    using Mis = BidirectionalMis;

public:
    template <class Stage>
    explicit ConnectionLanes(const Stage& s)
        : connect_(s.vertices), rules_(s.rules), on_(has_plain_lanes() && !rules_.singles.on),
          stage_{s.scene, s.wave, s.rules, s.hits, s.rays, s.emission, *this, s.record, s.camera_lane_known} {}

    void add(uint32_t i) { stage_(i); }

    /// What `stage_` does at a vertex.
    void at(const SceneView& scene, const Rules<Mis>&, const Vertex<Mis>& v, const Subpath<Mis>& path, uint32_t slot,
            const RandomNumbers& numbers) {
        if (rules_.next_event) connect_.next_event.at(scene, rules_, v, path, slot, numbers);
        if (!rules_.connect) return;
        const FusedClock clock(connect_.record, true);
        const auto& source = connect_.source;
        const auto lights = source.search(numbers.key, path.depth, v, rules_.max_depth, slot);
        uint32_t next = source.first(slot), found = lights.find(next);
        if (found == kNone) return;
        const bool plain = on_ && v.scattering.plain_diffuse();
        ConnectionVertex<Mis> eye;
        SubpathEnd<Mis> end;
        if (plain) eye = pack_connection_vertex(v, path, slot);
        for (bool has_end = false; found != kNone; found = lights.find(next)) {
            connect_.record->count_item(path.depth);
            const uint32_t k = count_;
            const ConnectionVertex<Mis> light = load_vertex<F>(source.vertices, found);
            place_[k] = found;
            plain_[k] = plain && light.bits().template diffuse<F>();
            one_by_one_[k].tmax = -1.0f;
            if (plain_[k]) {
                set_rows(pairs_.eye, eye);
                set_rows(pairs_.light, light);
            } else {
                if (!has_end) end = rounded_end<F>(scene, v, path);
                has_end = true;
                push_connection<F>(scene, rules_, source, *connect_.state, numbers, end, slot, light, found,
                                   connect_.next_event.inner.seeds, Keep{one_by_one_[k]}, connect_.record);
            }
            if (++count_ == PlainPairs::kMost) run();
        }
    }

    void run() {
        if (count_ == 0) return;
        const FusedClock clock(connect_.record);
        if (on_) plain_connections(rules_, pairs_, pairs_.padded(count_));
        for (uint32_t k = 0; k < count_; ++k) {
            if (plain_[k] && pairs_.origin[k].w >= 0.0f) push(k);
            if (one_by_one_[k].tmax >= 0.0f) connect_.next_event.inner.candidates.push(one_by_one_[k]);
        }
        count_ = 0;
    }

private:
    struct Keep {
        CandidateItem& item;

        void push(const CandidateItem& c) const { item = c; }
    };

    void set_rows(PlainPairs::Row<Vec4f>* rows, const ConnectionVertex<Mis>& vertex) {
        static_assert(ConnectionVertex<Mis>::kDiffuseLanes == 4);
        Vec4f words[4];
        memcpy(words, &vertex, sizeof(words));
        for (int row = 0; row < 4; ++row) rows[row][count_] = words[row];
    }
    void push(uint32_t k) const {
        const Vec4f value = pairs_.value[k], origin = pairs_.origin[k], direction = pairs_.direction[k];
        const uint32_t eye = VertexBits{float_bits(pairs_.eye[0][k].w)}.depth(),
                       light = VertexBits{float_bits(pairs_.light[0][k].w)}.depth();
        CandidateItem c = {};
        c.value = Rgb{value.x, value.y, value.z} * connect_.source.scale(*connect_.state);
        if (!is_valid_radiance(c.value, connect_.record)) return;
        c.path = float_bits(pairs_.eye[1][k].z);
        c.origin = {origin.x, origin.y, origin.z};
        c.tmax = origin.w;
        c.direction = {direction.x, direction.y, direction.z};
        c.ratio = value.w;
        c.strategy = Strategy::make(light + 1, eye + 1);
        if (connect_.next_event.inner.seeds)
            c.opacity_seed =
                eye_numbers(rules_.mis, stage_.wave, c.path)
                    .shadow_seed(connection_ray(eye, connect_.source.from_cache() ? kMaxDepth + place_[k] : light));
        connect_.next_event.inner.candidates.push(c);
    }

    const NextEventAndConnections<F, Out, LightVertexSource<Mis>>& connect_;
    const Rules<Mis>& rules_;
    const bool on_;
    EyeVertex<F, Mis, EmissionOut, ConnectionLanes&> stage_;
    uint32_t count_ = 0;
    uint32_t place_[PlainPairs::kMost];
    bool plain_[PlainPairs::kMost];
    CandidateItem one_by_one_[PlainPairs::kMost];
    PlainPairs pairs_;
};

}  // namespace ambilux
