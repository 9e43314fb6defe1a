// Random numbers of light subpaths.
#pragma once

#include "core/sobol.h"
#include "queues/wave.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

/// Of the light subpath of a slot. Sobol' points are shared out over the light subpaths of all pixels, as each may
/// reach any pixel.
template <class Mis>
AMBILUX_HD NumbersOf<Mis> light_numbers(const Mis& mis, const Wave& wave, uint32_t slot) {
    if constexpr (requires { mis.light_subpaths_per_tile; })
        return {light_point_key(wave.seed, light_subpath_number(wave, slot, mis.light_subpaths_per_tile))};
    else
        return {wave.key(slot, Stream::light)};
}

}  // namespace ambilux
