// What happens at the vertices of light subpaths (a photon is left) and of eye subpaths (photons are gathered).
#pragma once

#include "photons.h"
#include "stages/arrival.h"
#include "transport/subpath/visit.h"

namespace ambilux::photon_density {

/// At a vertex of a light subpath, in the place of a connection with the camera.
template <class Mis>
struct LeavePhoton {
    Wave wave;
    Queue<Photon> photons;
    uint32_t iteration_samples;

    AMBILUX_HD void at(const SceneView&, const Rules<Mis>&, const Vertex<Mis>& y, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>&) const {
        const PathSlot p = wave.locate(slot);
        const uint32_t first = wave.state->iteration * iteration_samples;
        photons.push({y.point.p, (p.sample - first) * wave.width * wave.height + p.pixel, path.direction, path.depth,
                      path.throughput, 0});
    }
};

/// The light that leaves vertex `z` of an eye subpath: photons within the radius over the area of its disk.
/// `most_depth`: of their subpaths.
template <Features F, class Mis>
AMBILUX_HD Rgb density(const State& state, const Grid& grid, const Vertex<Mis>& z, uint32_t most_depth) {
    const Vec3f p = z.point.p, r = {grid.radius, grid.radius, grid.radius};
    const auto cell = [&](Vec3f q, uint32_t(&c)[3]) {
        c[0] = grid.along(q.x, grid.low.x), c[1] = grid.along(q.y, grid.low.y), c[2] = grid.along(q.z, grid.low.z);
    };
    uint32_t first[3], last[3];
    cell(p - r, first);
    cell(p + r, last);
    const uint64_t* keys = state.order.keys[1];
    const uint32_t count = state.photons.counter->size();
    Rgb sum = {0.0f, 0.0f, 0.0f};
    for (uint32_t cy = first[1]; cy <= last[1]; ++cy)
        for (uint32_t cz = first[2]; cz <= last[2]; ++cz) {
            const uint32_t row = grid.row(cy, cz);
            uint32_t i = lower_bound(keys, count, cell_key(row + first[0]));
            for (; i < count && keys[i] >> kCellShift <= row + last[0]; ++i) {
                const Photon photon = state.photons.load(state.order.values[1][i]);
                const float cosine = fabsf(dot(z.point.ng, photon.d));
                if (length_squared(photon.p - p) > sqr(grid.radius) || photon.depth > most_depth || !(cosine > 0.0f))
                    continue;
                // Flux over an area has the cosine already that the BSDF's value has too.
                sum +=
                    scatter_eval<F>(z.scattering, -photon.d, TransportMode::radiance) * photon.flux * (1.0f / cosine);
            }
        }
    return sum * (kInvPi / sqr(grid.radius));
}

/// An eye subpath goes on through deltas and ends at its first other vertex.
template <Features F, class Mis>
struct Gather {
    static constexpr const char* kName = "gather_photons";
    using Items = SubpathItems<Mis>;
    using RayItem = typename Items::Ray;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Settings settings;
    Queue<HitItem<RayItem>> hits;
    Queue<RayItem> rays;
    State state;
    Accumulate samples;
    StageRecord* record;
    float light_subpaths;  ///< of the iteration

    const Queue<HitItem<RayItem>>& items() const { return hits; }
    AMBILUX_HD HitItem<RayItem> hit(uint32_t i) const { return hits.load(i); }
    AMBILUX_HD void operator()(uint32_t i) const {
        RayItem next;
        if (step(hit(i), next)) rays.push(next);
    }

    struct Sink {
        const Gather& stage;
        uint32_t slot;
        bool& gathered;

        AMBILUX_HD NumbersOf<Mis> numbers() const { return {stage.wave.key(slot)}; }
        AMBILUX_HD void add(const Candidate<Mis>& c) const { stage.samples.push(Contribution{c.value, slot}); }
        AMBILUX_HD void at(const Vertex<Mis>& z, const Subpath<Mis>& path, const NumbersOf<Mis>&) const {
            const Grid grid = Grid::of(stage.scene, stage.settings, stage.wave.state->iteration);
            const Rgb light =
                density<F>(stage.state, grid, z, stage.rules.max_depth - path.depth) * (1.0f / stage.light_subpaths);
            stage.samples.push(Contribution{path.throughput * light, slot});
            gathered = true;
        }
        AMBILUX_HD bool valid(Rgb throughput) const { return !gathered && is_valid_radiance(throughput, stage.record); }
    };

    AMBILUX_HD bool step(const HitItem<RayItem>& h, RayItem& next) const {
        Subpath<Mis> path = Items::unpack(h.ray);
        bool gathered = false;
        if (!visit<F>(scene, rules, Side::eye, rules.longest(Side::eye), h.hit(), path,
                      Sink{*this, h.ray.path, gathered}))
            return false;
        next = Items::pack(path, Side::eye, h.ray.path, kInfinity);
        return true;
    }
};

}  // namespace ambilux::photon_density
