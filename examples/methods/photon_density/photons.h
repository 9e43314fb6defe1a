// Photons: vertices of light subpaths, with the light that arrives there; and how they lie in cells.
#pragma once

#include "integrators/kept_state.h"
#include "settings.h"
#include "stages/stage.h"

namespace ambilux::photon_density {

struct Photon {
    Vec3f p;
    uint32_t subpath;  ///< number of its light subpath in the iteration
    Vec3f d;           ///< unit, of the light
    uint32_t depth;    ///< segments of the light subpath up to here
    Rgb flux;          ///< over the number of light subpaths it is what arrives
    uint32_t pad;
};

/// A radius, and cells that are no smaller. Both follow from the number of the iteration.
struct Grid {
    static constexpr uint32_t kMostCells = 128;  ///< along an axis: three times 7 bits of a key

    Vec3f low;
    float radius, cells_per_length;
    uint32_t cells;  ///< along an axis

    AMBILUX_HD static Grid of(const SceneView& scene, const Settings& settings, uint32_t iteration) {
        Grid g;
        const float size = scene.bounds_radius;
        g.radius = settings.radius * size * powf(float(iteration + 1), 0.5f * (settings.alpha - 1.0f));
        g.cells = max(1u, uint32_t(min(2.0f * size / g.radius, float(kMostCells))));
        g.cells_per_length = float(g.cells) / (2.0f * size);
        g.low = scene.bounds_center - Vec3f{size, size, size};
        return g;
    }
    AMBILUX_HD uint32_t along(float x, float low_x) const {
        return uint32_t(min(max((x - low_x) * cells_per_length, 0.0f), float(cells - 1)));
    }
    AMBILUX_HD uint32_t row(uint32_t y, uint32_t z) const { return (z * cells + y) * cells; }
    AMBILUX_HD uint32_t cell(Vec3f p) const { return row(along(p.y, low.y), along(p.z, low.z)) + along(p.x, low.x); }
};

/// Keys put photons in order of cell, light subpath and depth: an order that knows nothing of waves and threads, so
/// that sums over a cell have the same bits for any number of them.
constexpr uint32_t kCellShift = 43;
AMBILUX_HD uint64_t cell_key(uint32_t cell) { return uint64_t(cell) << kCellShift; }
AMBILUX_HD uint64_t photon_key(uint32_t cell, const Photon& photon) {
    return cell_key(cell) | uint64_t(photon.subpath) << 11 | (photon.depth & 0x7ffu);
}

/// What lives as long as an iteration: the photons of all its waves. Nothing outlives it, and the radius follows from
/// its number.
struct State {
    static constexpr StateKind kKind = StateKind::by_index;

    Queue<Photon> photons;
    SortMemory<uint64_t> order;  ///< their keys and places

    template <class Policy>
    static State lay_out(Layout& layout, const Policy&, const StateSize& size) {
        State s;
        s.photons = layout.growing_queue<Photon>("photons", size.appended);
        s.order = SortMemory<uint64_t>::lay_out(layout, size.appended, size.primitives);
        return s;
    }
    template <class Policy, class Put>
    void init(const Policy&, Put) const {}
    template <class Visit>
    void for_each_saved(Visit) const {}
    /// Of `old`, which had too little room.
    template <class Copy>
    void take_items(const State& old, uint32_t items, Copy copy) const {
        for (uint32_t lane = 0; lane < LaneArray<Photon>::kLanes; ++lane)
            copy(photons.items.base + photons.items.place(0, lane),
                 old.photons.items.base + old.photons.items.place(0, lane), items);
        copy(order.keys[0], old.order.keys[0], items);
        copy(order.values[0], old.order.values[0], items);
    }
};

/// Photons of a wave become photons of all.
struct Append {
    static constexpr const char* kName = "append_photons";

    SceneView scene;
    Wave wave;
    Settings settings;
    Queue<Photon> mine;
    State all;
    StageRecord* record;

    const Queue<Photon>& items() const { return mine; }
    QueueCounter* target() const { return all.photons.counter; }

    AMBILUX_HD void operator()(uint32_t i, uint32_t place) const {
        const Photon photon = mine.load(i);
        all.photons.store(place, photon);
        all.order.keys[0][place] = photon_key(Grid::of(scene, settings, wave.state->iteration).cell(photon.p), photon);
        all.order.values[0][place] = place;
    }
};

}  // namespace ambilux::photon_density
