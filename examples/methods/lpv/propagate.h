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
/// Each step adds what was injected, so that the light of a cell is the sum over the steps of the paper. Beyond the
/// border of a finer grid lies the light of the larger one. (The paper's grids know nothing of each other, so that what
/// lies outside of one does not light it.)
struct Propagate {
    static constexpr const char* kName = "propagate";

    Cascades cascades;
    State state;
    float occlusion;
    uint32_t cascade, step;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const Grid& grid = cascades.grids[cascade];
        const Cell cell = grid.cell_of(i);
        Intensity sum = {};  // of fluxes, times the axes that their lobes are about
        for (int axis = 0; axis < 3; ++axis)
            for (float sign = -1.0f; sign <= 1.0f; sign += 2.0f) {
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
                    for (float side = -1.0f; side <= 1.0f; side += 2.0f) {
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
        sum.add(splat(1.0f), state.injected[i]);
        state.light[1 - (step & 1)][i] = state.total[cascade * grid.cells() + i] = sum;
    }

private:
    /// Intensity of the cell that a step along `axis` to `sign` leaves to reach `cell`. False if there is none.
    AMBILUX_HD bool neighbour(Cell cell, int axis, float sign, Intensity& from) const {
        const uint32_t n = cascades.grids[cascade].resolution;
        const int32_t x = cell.at[axis] -= sign > 0.0f ? 1 : -1;
        if (x >= 0 && x < int32_t(n))
            from = state.light[step & 1][site(n, uint32_t(cell.at[0]), uint32_t(cell.at[1]), uint32_t(cell.at[2]))];
        else if (cascade > 0)
            from = cascades.from_larger(state.total, cascade, cell);
        else
            return false;
        return true;
    }
    /// Mean over the corners of the face through which that step leads.
    AMBILUX_HD Harmonics<float> blocking(const Cell& cell, int axis, float sign) const {
        Harmonics<float> mean = {};
        if (!(occlusion > 0.0f)) return mean;
        const Grid& grid = cascades.grids[cascade];
        for (uint32_t k = 0; k < 4; ++k) {
            uint32_t at[3] = {uint32_t(cell.at[0]), uint32_t(cell.at[1]), uint32_t(cell.at[2])};
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
