// Random numbers of the subpaths of a slot.
#pragma once

#include "core/sobol.h"
#include "queues/wave.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

/// `slot`: its number or what it stands for.
template <class Mis, class Slot>
AMBILUX_HD NumbersOf<Mis> eye_numbers(const Mis& mis, const Wave& wave, const Slot& slot) {
    if constexpr (requires { mis.sobol; })
        if (mis.sobol) return {of_point_set(wave.key(slot))};
    return {wave.key(slot)};
}

/// Sobol' points are shared out over the light subpaths of all pixels, as each may reach any pixel.
template <class Mis>
AMBILUX_HD NumbersOf<Mis> light_numbers(const Mis& mis, const Wave& wave, uint32_t slot) {
    if constexpr (requires { mis.sobol; })
        if (mis.sobol) {
            const uint64_t number = light_subpath_number(wave, slot, mis.light_subpaths_per_tile);
            return {of_point_set(light_point_key(wave.seed, number))};
        }
    return {wave.key(slot, Stream::light)};
}

}  // namespace ambilux
