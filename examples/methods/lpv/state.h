// What lives as long as an iteration: virtual lights, and the grids that are made of them.
#pragma once

#include "grids.h"
#include "integrators/kept_state.h"

namespace ambilux::lpv {

/// Where a light subpath first met a surface.
struct VirtualLight {
    Vec3f p, n;          ///< n: unit, to the side that the light leaves to
    Rgb flux;            ///< that is reflected or transmitted, its share of the iteration's light subpaths
    uint32_t iteration;  ///< that it belongs to, counted from 1
};

/// Keys of sites are below 2^kKeyBits.
constexpr uint32_t kKeyBits = 24;

struct State {
    static constexpr StateKind kKind = StateKind::by_index;

    VirtualLight* lights;        ///< by number of the light subpath in the iteration
    SortMemory<uint32_t> order;  ///< sites of all grids, from 1 on, and the lights there; 0: outside
    Intensity* injected;         ///< of one grid
    Intensity* light[2];         ///< of one grid, before and after a step
    Intensity* total;            ///< of all grids, after the last step
    Harmonics<float>* blocking;  ///< of all grids, at corners of cells: share of the flux in a direction

    template <class Policy>
    static State lay_out(Layout& layout, const Policy& p, const StateSize& size) {
        const uint32_t lights = p.light_subpaths, grids = lights ? p.cascades.count : 0,
                       cells = p.cascades.grids[0].cells();
        State s;
        s.lights = layout.allocate<VirtualLight>(lights);
        s.order = SortMemory<uint32_t>::lay_out(layout, lights * grids, size.primitives);
        for (Intensity** one : {&s.injected, &s.light[0], &s.light[1]})
            *one = layout.allocate<Intensity>(grids ? cells : 0);
        s.total = layout.allocate<Intensity>(uint64_t(grids) * cells);
        s.blocking = layout.allocate<Harmonics<float>>(uint64_t(grids) * p.cascades.grids[0].corners());
        return s;
    }
    template <class Policy, class Put>
    void init(const Policy&, Put) const {}
    template <class Visit>
    void for_each_saved(Visit) const {}
};

}  // namespace ambilux::lpv
