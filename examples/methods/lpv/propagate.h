// One step of propagation: what enters a cell from its six neighbours (Kaplanyan and Dachsbacher 2010, section 4.3).
#pragma once

#include "stages/stage.h"
#include "state.h"

namespace ambilux::lpv {

/// Solid angles of the faces of the next cell, seen from the centre of this one: of the one opposite, 4 asin(1/10), and
/// of the four beside it, so that the five are a sixth of the sphere. Hence a step conserves the flux of all cells.
constexpr float kFrontAngle = 0.400669685f, kSideAngle = 0.423431354f;
/// Direction to the middle of a face beside: along the step and across it, 1 and 1/2 over their length.
constexpr float kSideAlong = 0.894427191f, kSideAcross = 0.447213595f;

/// The flux that a neighbour's intensity, along the direction to its middle, sends to each face becomes the cosine lobe
/// of that flux about the normal of the face. Negative intensities of the two bands stay, so that flux is conserved.
/// The first step of a finer grid has as neighbours beyond its border what the larger one holds there, the sum of all
/// its steps: light from outside arrives. (The paper's grids know nothing of each other.)
struct Propagate {
    static constexpr const char* kName = "propagate";

    Cascades cascades;
    State state;
    float occlusion;
    uint32_t cascade, step;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t n = cascades.grids[cascade].resolution;
        const int32_t cell[3] = {int32_t(i % n), int32_t(i / n % n), int32_t(i / (n * n))};
        Intensity sum = {};  // of fluxes, times the axes that their lobes are about
        for (int axis = 0; axis < 3; ++axis)
            for (const float sign : {-1.0f, 1.0f}) {
                Intensity from;
                if (!neighbour(cell, axis, sign, from)) continue;
                const Harmonics<float> blocked = blocking(cell, axis, sign);
                const Rgb all = from.c0 * kBand0, along = from.c1[axis] * (sign * kBand1);
                Vec3f d = {0.0f, 0.0f, 0.0f};
                d[axis] = sign;
                const Rgb front = (all + along) * (kFrontAngle * passing(blocked, d));
                sum.c0 += front;
                sum.c1[axis] += front * sign;
                d[axis] = sign * kSideAlong;
                for (int across = 0; across < 3; ++across) {
                    if (across == axis) continue;
                    for (const float side : {-1.0f, 1.0f}) {
                        d[across] = side * kSideAcross;
                        const Rgb flux = (all + along * kSideAlong + from.c1[across] * (d[across] * kBand1)) *
                                         (kSideAngle * passing(blocked, d));
                        sum.c0 += flux;
                        sum.c1[across] += flux * side;
                    }
                    d[across] = 0.0f;
                }
            }
        sum.c0 *= kCosine0 * kInvPi;
        for (Rgb& c : sum.c1) c *= kCosine1 * kInvPi;
        state.flow[1 - (step & 1)][i] = sum;
        state.total[cascade * n * n * n + i].add(splat(1.0f), sum);
    }

private:
    /// Intensity of the cell that a step along `axis` to `sign` leaves to reach `cell`. False if there is none.
    AMBILUX_HD bool neighbour(const int32_t (&cell)[3], int axis, float sign, Intensity& from) const {
        const Grid& grid = cascades.grids[cascade];
        int32_t at[3] = {cell[0], cell[1], cell[2]};
        at[axis] -= sign > 0.0f ? 1 : -1;
        if (at[axis] >= 0 && at[axis] < int32_t(grid.resolution)) {
            from = state.flow[step & 1][site(grid.resolution, uint32_t(at[0]), uint32_t(at[1]), uint32_t(at[2]))];
            return true;
        }
        if (cascade == 0 || step > 0) return false;
        const Vec3f middle = Vec3f{float(at[0]), float(at[1]), float(at[2])} + splat(0.5f);
        const Grid& outer = cascades.grids[cascade - 1];
        from = {};
        from.add(splat(sqr(grid.cell / outer.cell)),
                 outer.interpolate(state.total + (cascade - 1) * outer.cells(), grid.low + middle * grid.cell));
        return true;
    }
    /// Mean over the corners of the face through which that step leads.
    AMBILUX_HD Harmonics<float> blocking(const int32_t (&cell)[3], int axis, float sign) const {
        Harmonics<float> mean = {};
        if (!(occlusion > 0.0f)) return mean;
        const Grid& grid = cascades.grids[cascade];
        for (uint32_t k = 0; k < 4; ++k) {
            uint32_t at[3] = {uint32_t(cell[0]), uint32_t(cell[1]), uint32_t(cell[2])};
            at[axis] += sign < 0.0f;
            at[(axis + 1) % 3] += k & 1;
            at[(axis + 2) % 3] += k >> 1;
            mean.add(0.25f, state.blocking[cascade * grid.corners() + site(grid.resolution + 1, at[0], at[1], at[2])]);
        }
        return mean;
    }
    AMBILUX_HD float passing(const Harmonics<float>& blocked, Vec3f d) const {
        return 1.0f - occlusion * clamp(blocked.at(d), 0.0f, 1.0f);
    }
};

}  // namespace ambilux::lpv
