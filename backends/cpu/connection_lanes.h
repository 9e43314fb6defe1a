// Connections of plain eye vertices in lanes: pairs with plain light vertices are gathered, computed side by side and
// pushed in their order; others go one by one.
#pragma once

#include "backends/cpu/plain_connections.h"
#include "backends/cpu/plain_vertices.h"
#include "stages/connect_vertices.h"
#include "stages/subpath_numbers.h"

namespace ambilux {

/// Runs EyeVertex with NextEventAndConnections for items one after the other: add() them, and then run().
template <Features F, class EmissionOut, class Out>
class ConnectionLanes {
    using Mis = BidirectionalMis;
    using Source = LightVertexSource<Mis>;

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
        if (!on_ || !v.scattering.plain_diffuse()) return connect_.connect(scene, rules_, v, path, slot, numbers);
        const FusedClock clock(connect_.record, true);
        const Source& source = connect_.source;
        const uint32_t size = source.vertices.counter->size();
        uint32_t next = size > 0 && path.depth + 2 <= rules_.max_depth ? source.first(slot) : kNone;
        if (next == kNone) return;
        const Scattering& s = v.scattering;
        const Rgb throughput = path.throughput * s.bsdf.inputs.colors[0];
        const Vec4f eye[5] = {{v.point.p.x, v.point.p.y, v.point.p.z, bits_float(path.depth)},
                              {s.ng.x, s.ng.y, s.ng.z, v.offset},
                              {s.frame.n.x, s.frame.n.y, s.frame.n.z, v.sums.dvcm},
                              {path.direction.x, path.direction.y, path.direction.z, 0.0f},
                              {throughput.x, throughput.y, throughput.z, v.sums.dvc}};
        const auto lights = source.search(numbers.key, path.depth, v, rules_.max_depth, slot);
        SubpathEnd<Mis> end;
        bool has_end = false;
        while (next != kNone) {  // as LightVertexSearch::find, which tests the vertices at once
            const uint32_t place = source.from_cache() ? lights.drawn(--next, size) : next, k = count_;
            const ConnectionVertex<Mis> light = source.vertices.items.load(place, kLightRows);
            if (!source.from_cache())
                next = light.front.link;
            else if (next == 0)
                next = kNone;
            slot_[k] = slot;
            place_[k] = place;
            one_by_one_[k].tmax = PlainPairs::kNone;
            plain_[k] = light.bits().template diffuse<F>();
            if (plain_[k]) {
                for (int row = 0; row < 5; ++row) pairs_.eye[row][k] = eye[row];
                Vec4f rows[kLightRows];
                memcpy(rows, &light, sizeof(rows));
                for (uint32_t row = 0; row < kLightRows; ++row) pairs_.light[row][k] = rows[row];
            } else if (path.depth + light.bits().depth() + 1 <= rules_.max_depth && may_connect(light.front, v)) {
                if (!has_end) end = rounded_end<F>(scene, v, path);
                has_end = true;
                connect_.record->count_item(path.depth);
                push_connection<F>(scene, rules_, source, *connect_.state, numbers, end, slot,
                                   load_vertex<F>(source.vertices, place), place, connect_.next_event.inner.seeds,
                                   Keep{one_by_one_[k]}, connect_.record);
            }
            if (++count_ == PlainPairs::kMost) run();
        }
    }

    void run() {
        if (count_ == 0) return;
        const FusedClock clock(connect_.record);
        constexpr uint32_t kWidth = PlainPairs::kWidth;
        const uint32_t padded = (count_ + kWidth - 1) / kWidth * kWidth;
        plain_connections(rules_, pairs_, padded);
        uint32_t found = 0;
        for (uint32_t k = 0; k < count_; ++k) {
            if (plain_[k]) {
                found += pairs_.direction[k].w > 0.0f;
                if (pairs_.origin[k].w >= 0.0f) push(k);
            } else if (one_by_one_[k].tmax >= 0.0f) {
                connect_.next_event.inner.candidates.push(one_by_one_[k]);
            }
        }
        connect_.record->count_items(found, connect_.state->depth);
        count_ = 0;
    }

private:
    static constexpr uint32_t kLightRows = ConnectionVertex<Mis>::kDiffuseLanes;

    struct Keep {
        CandidateItem& item;

        void push(const CandidateItem& c) const { item = c; }
    };

    void push(uint32_t k) const {
        const Vec4f value = pairs_.value[k], origin = pairs_.origin[k], direction = pairs_.direction[k];
        const uint32_t eye = float_bits(pairs_.eye[0][k].w),
                       light = VertexBits{float_bits(pairs_.light[0][k].w)}.depth();
        CandidateItem c = {};
        c.value = Rgb{value.x, value.y, value.z} * connect_.source.scale(*connect_.state);
        if (!is_valid_radiance(c.value, connect_.record)) return;
        c.path = slot_[k];
        c.origin = {origin.x, origin.y, origin.z};
        c.tmax = origin.w;
        c.direction = {direction.x, direction.y, direction.z};
        c.ratio = value.w;
        c.strategy = Strategy::make(light + 1, eye + 1);
        if (connect_.next_event.inner.seeds)
            c.opacity_seed =
                eye_numbers(rules_.mis, stage_.wave, slot_[k])
                    .shadow_seed(connection_ray(eye, connect_.source.from_cache() ? kMaxDepth + place_[k] : light));
        connect_.next_event.inner.candidates.push(c);
    }

    const NextEventAndConnections<F, Out, Source>& connect_;
    const Rules<Mis>& rules_;
    const bool on_;
    EyeVertex<F, Mis, EmissionOut, ConnectionLanes&> stage_;
    uint32_t count_ = 0;
    uint32_t slot_[PlainPairs::kMost], place_[PlainPairs::kMost];
    bool plain_[PlainPairs::kMost];
    CandidateItem one_by_one_[PlainPairs::kMost];
    PlainPairs pairs_;
};

}  // namespace ambilux
