// Nested grids of cubic cells around a centre.
#pragma once

#include "harmonics.h"
#include "scene/scene.h"
#include "settings.h"

namespace ambilux::lpv {

using Intensity = Harmonics<Rgb>;  ///< of a cell, per solid angle

struct Cell {
    int32_t at[3];
};

/// Number of a site among `along`^3.
AMBILUX_HD uint32_t site(uint32_t along, uint32_t x, uint32_t y, uint32_t z) { return (z * along + y) * along + x; }

struct Grid {
    Vec3f low;
    float cell;  ///< edge
    uint32_t resolution;

    AMBILUX_HD uint32_t cells() const { return resolution * resolution * resolution; }
    AMBILUX_HD uint32_t corners() const { return (resolution + 1) * (resolution + 1) * (resolution + 1); }
    /// The site of `along`^3 whose cube holds `p`, in cells from `low`; kNone if there is none.
    AMBILUX_HD static uint32_t site_at(Vec3f p, uint32_t along) {
        const float most = float(along);
        const bool inside = p.x >= 0.0f && p.y >= 0.0f && p.z >= 0.0f && p.x < most && p.y < most && p.z < most;
        return inside ? site(along, uint32_t(p.x), uint32_t(p.y), uint32_t(p.z)) : kNone;
    }
    AMBILUX_HD Cell cell_of(uint32_t i) const {
        const uint32_t n = resolution;
        return {{int32_t(i % n), int32_t(i / n % n), int32_t(i / (n * n))}};
    }
    AMBILUX_HD Vec3f in_cells(Vec3f p) const { return (p - low) * (1.0f / cell); }
    /// 1 inside, 0 from half a cell before the border on, where cells on all sides are missing; between, over one cell.
    AMBILUX_HD float weight(Vec3f p) const {
        const Vec3f c = in_cells(p);
        const float edge = min(min_component(c), float(resolution) - max(max(c.x, c.y), c.z));
        return clamp(edge - 0.5f, 0.0f, 1.0f);
    }
    /// Trilinear, between the centres of `cells`; outside there is nothing.
    AMBILUX_HD Intensity interpolate(const Intensity* cells, Vec3f p) const {
        const Vec3f c = in_cells(p) - splat(0.5f), first = {floorf(c.x), floorf(c.y), floorf(c.z)}, part = c - first;
        Intensity sum = {};
        for (int k = 0; k < 8; ++k) {
            const Vec3f corner = {float(k & 1), float(k >> 1 & 1), float(k >> 2)};
            float weight = 1.0f;
            for (int a = 0; a < 3; ++a) weight *= corner[a] > 0.0f ? part[a] : 1.0f - part[a];
            const uint32_t from = site_at(first + corner, resolution);
            if (from != kNone) sum.add(splat(weight), cells[from]);
        }
        return sum;
    }
};

/// From the largest to the smallest.
struct Cascades {
    Grid grids[kMostCascades];
    uint32_t count;

    static Cascades plan(const Scene& scene, const Settings& settings);
    /// What the next larger grid tells of a cell of grid `c`, or of one beside it. `total`: of all grids. Radiance is
    /// the same, so that intensities are as areas of faces.
    AMBILUX_HD Intensity from_larger(const Intensity* total, uint32_t c, const Cell& cell) const {
        const Grid &grid = grids[c], &larger = grids[c - 1];
        const Vec3f middle = Vec3f{float(cell.at[0]), float(cell.at[1]), float(cell.at[2])} + splat(0.5f);
        Intensity light = {};
        light.add(splat(sqr(grid.cell / larger.cell)),
                  larger.interpolate(total + (c - 1) * larger.cells(), grid.low + middle * grid.cell));
        return light;
    }
};

}  // namespace ambilux::lpv
