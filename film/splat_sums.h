// What light subpaths bring to the pixels.
#pragma once

#include "core/lane.h"
#include "film/fixed_point.h"

namespace ambilux {

/// A cell per pixel and sample of a wave, of one of two kinds. Fixed point does not depend on the order in which
/// threads add. A cell of floats takes one operation of memory instead of three: n values are added up with an error of
/// at most n 2^-24 of their sum.
struct SplatSums {
    int64_t* fixed = nullptr;  ///< three per cell in units of kLightUnit
    Lane* floats = nullptr;    ///< or a lane per cell

    AMBILUX_HD bool exists() const { return fixed || floats; }
    /// False if the light does not fit. `alone`: few other threads of the warp, if any, add to the same cell.
    AMBILUX_HD bool add(uint64_t cell, Rgb value, bool alone) const {
        if (fixed) return add_light(fixed + cell * 3, value);
        if (!(max_component(value) < kTooMuchLight)) return false;
        if (!alone && max_component(value) < kLargeLight) {
            const SameKey lanes = same_key(reinterpret_cast<uintptr_t>(floats + cell));
            if (lanes.several()) {
                FixedLight light = FixedLight::of(value);
                if (!gather_light(lanes, light)) return true;
                value = light.rgb();
            }
        }
        add_rgb(reinterpret_cast<float*>(floats + cell), value);
        return true;
    }
    AMBILUX_HD void read(uint64_t cell, double (&value)[3]) const {
        const Rgb sum = fixed ? Rgb{} : start_of<Rgb>(floats[cell]);
        for (int c = 0; c < 3; ++c) value[c] = fixed ? double(fixed[cell * 3 + c]) * kLightUnit : double(sum[c]);
    }
    AMBILUX_HD void clear(uint64_t cell) const {
        if (!fixed)
            floats[cell] = {};
        else
            for (int c = 0; c < 3; ++c) fixed[cell * 3 + c] = 0;
    }
};

}  // namespace ambilux
