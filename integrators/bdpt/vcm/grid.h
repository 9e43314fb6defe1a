// Where the light vertices of an iteration lie: cells of twice the radius, of which a hash table holds the starts.
#pragma once

#include <bit>

#include "integrators/bdpt/vcm/merge_keys.h"
#include "integrators/bdpt/vcm/merging_mis.h"
#include "integrators/kept_state.h"
#include "stages/vertex_queues.h"

namespace ambilux {

/// What is looked at of the many vertices that are near but not within the radius.
struct MergePlace {
    Vec3f p;
    uint32_t depth;  ///< segments of the light subpath up to here
};

/// Words of the sums that merges ask light vertices for: those that vertices keep, or Sums::kLightWords.
template <class Sums>
constexpr uint32_t light_words() {
    if constexpr (requires { Sums::kLightWords; })
        return Sums::kLightWords;
    else
        return vertex_words<Sums>();
}

/// A light vertex as a merge sees it.
template <class Mis>
struct MergeVertexOf {
    using Sums = PackedSums<3, light_words<typename Mis::Sums>()>;

    MergePlace front;
    Rgb flux;  ///< over the number of light subpaths it is what arrives
    float sum0;
    Vec2f d;  ///< of the light, octahedral map
    float sum1, sum2;
    typename Sums::More more;

    AMBILUX_HD static MergeVertexOf make(MergePlace front, Rgb flux, Vec2f d, const typename Mis::Sums& sums) {
        const Sums s = Sums::pack(sums);
        return {front, flux, s.word[0], d, s.word[1], s.word[2], s.more};
    }
    AMBILUX_HD typename Mis::Sums sums() const {
        return Sums{{sum0, sum1, sum2}, more}.template unpack<typename Mis::Sums>();
    }
};
using MergeVertex = MergeVertexOf<MergingMis>;
static_assert(sizeof(MergeVertex) == 3 * 16);

/// A cell of the grid.
struct MergeCell {
    int32_t x, y, z;

    AMBILUX_HD bool operator==(const MergeCell& o) const { return x == o.x && y == o.y && z == o.z; }
    /// Cells that share a place in the table are told apart by the places of their vertices.
    AMBILUX_HD uint32_t hash(uint32_t bits) const {
        uint32_t h = uint32_t(x) * 0x9e3779b1u ^ uint32_t(y) * 0x85ebca77u ^ uint32_t(z) * 0xc2b2ae3du;
        h = (h ^ h >> 15) * 0x2c1b3c6du;
        h = (h ^ h >> 12) * 0x297a2d39u;
        return (h ^ h >> 15) >> (32 - bits);
    }
};

/// Cells have edges of twice the radius, so that a ball lies in at most eight.
struct MergeGrid {
    Vec3f low;
    float cells_per_length;

    AMBILUX_HD static MergeGrid of(const SceneView& scene, float radius) {
        const float size = scene.bounds_radius;
        return {scene.bounds_center - Vec3f{size, size, size}, 0.5f / radius};
    }
    AMBILUX_HD MergeCell cell(Vec3f p) const {
        const Vec3f c = (p - low) * cells_per_length;
        return {int32_t(floorf(c.x)), int32_t(floorf(c.y)), int32_t(floorf(c.z))};
    }
    /// The cell of the eight around `p` with the smallest coordinates.
    AMBILUX_HD MergeCell first_cell(Vec3f p) const {
        const Vec3f c = (p - low) * cells_per_length;
        return {int32_t(floorf(c.x - 0.5f)), int32_t(floorf(c.y - 0.5f)), int32_t(floorf(c.z - 0.5f))};
    }
};

/// Light vertices: as merges see them and, where subpaths are connected, as connections do.
template <class Mis>
struct VcmVerticesOf {
    Queue<MergeVertexOf<Mis>> merges;
    LaneArray<ConnectionVertex<Mis>> connections;  ///< at the places of `merges`
    uint64_t* keys;                                ///< likewise

    /// `growing`: the name of the queue.
    template <class Policy>
    static VcmVerticesOf lay_out(Layout& layout, const char* growing, const Policy& p, uint32_t n) {
        VcmVerticesOf v;
        v.merges = layout.growing_queue<MergeVertexOf<Mis>>(growing, p.keeps_vertices ? n : 0);
        v.connections = layout.array<ConnectionVertex<Mis>>(p.rules.connect ? n : 0, p.vertex_lanes);
        return v;
    }
};
using VcmVertices = VcmVerticesOf<MergingMis>;

/// What lives as long as iterations that are done at once: the light vertices of all their waves. Nothing outlives
/// them, and the radius follows from their number.
template <class Mis>
struct VcmStateOf {
    static constexpr StateKind kKind = StateKind::by_index;

    VcmVerticesOf<Mis> all;                ///< as they were appended; keys are those of `order`
    LaneArray<MergeVertexOf<Mis>> sorted;  ///< in the order of keys
    LaneArray<ConnectionVertex<Mis>> sorted_connections;
    SortMemory<uint64_t> order;  ///< keys and places
    uint32_t* starts;            ///< in the order of keys: of each place in the tables of all iterations, and the end
    uint32_t places;             ///< in these tables
    MergeKeys keys;
    uint32_t lanes;  ///< of a vertex for connections

    template <class Policy>
    static VcmStateOf lay_out(Layout& layout, const Policy& p, const StateSize& size) {
        const uint32_t n = p.keeps_vertices ? size.appended : 0;
        VcmStateOf s;
        s.all = VcmVerticesOf<Mis>::lay_out(layout, "merge_vertices", p, n);
        s.sorted = layout.array<MergeVertexOf<Mis>>(n);
        s.sorted_connections = layout.array<ConnectionVertex<Mis>>(p.rules.connect ? n : 0, p.vertex_lanes);
        s.order = SortMemory<uint64_t>::lay_out(layout, n, size.primitives);
        s.all.keys = s.order.keys[0];
        s.places = p.waves.iterations_together << p.keys.table_bits;
        s.starts = layout.allocate<uint32_t>(uint64_t(s.places) + 1);
        s.keys = p.keys;
        s.lanes = p.vertex_lanes;
        return s;
    }
    uint32_t key_bits() const { return keys.shift() + uint32_t(std::bit_width(places - 1)); }
    /// The vertices in order, for connections that draw from them.
    AMBILUX_HD Queue<ConnectionVertex<Mis>> drawn() const {
        Queue<ConnectionVertex<Mis>> q;
        q.items = sorted_connections;
        q.counter = all.merges.counter;
        return q;
    }

    template <class Policy, class Put>
    void init(const Policy&, Put) const {}
    template <class Visit>
    void for_each_saved(Visit) const {}
    /// Of `old`, which had too little room.
    template <class Copy>
    void take_items(const VcmStateOf& old, uint32_t items, Copy copy) const {
        take_lanes(all.merges.items, old.all.merges.items, LaneArray<MergeVertexOf<Mis>>::kLanes, items, copy);
        if (all.connections.capacity > 0) take_lanes(all.connections, old.all.connections, lanes, items, copy);
        copy(order.keys[0], old.order.keys[0], items);
        copy(order.values[0], old.order.values[0], items);
    }
};
using VcmState = VcmStateOf<MergingMis>;

/// Light vertices within a radius, one after the other.
template <class Mis>
struct NearVertices {
    const VcmStateOf<Mis>& state;
    MergeGrid grid;
    uint32_t iteration;  ///< of those that are done at once
    Vec3f p;
    float radius;
    MergeCell first;
    uint32_t cells = 0;  ///< that were begun, of eight
    uint32_t place = 0, end = 0;

    AMBILUX_HD NearVertices(const VcmStateOf<Mis>& s, const MergeGrid& g, uint32_t i, Vec3f center, float r)
        : state(s), grid(g), iteration(i), p(center), radius(r), first(g.first_cell(center)) {}

    /// The next, or kNone after the last. One loop over cells and their vertices: threads of a warp that begin a cell
    /// do not wait for those that look at vertices.
    AMBILUX_HD uint32_t next() {
        while (place < end || cells < 8) {
            if (place < end) {
                const uint32_t i = place++;
                const Vec3f q = state.sorted.load_front(i).p;
                if (length_squared(q - p) <= sqr(radius) && grid.cell(q) == cell(cells - 1)) return i;
            } else {
                const uint32_t at = state.keys.place(iteration, cell(cells++).hash(state.keys.table_bits));
                place = state.starts[at];
                end = state.starts[at + 1];
            }
        }
        return kNone;
    }

private:
    AMBILUX_HD MergeCell cell(uint32_t k) const {
        return {first.x + int32_t(k & 1), first.y + int32_t(k >> 1 & 1), first.z + int32_t(k >> 2)};
    }
};

}  // namespace ambilux
