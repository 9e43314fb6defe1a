// Random numbers of what eye vertices draw from a cache of light vertices.
#pragma once

#include "core/rng.h"

namespace ambilux {

/// Most light vertices that an eye vertex draws from a cache.
constexpr uint32_t kMaxCacheDraws = 256;

/// Random numbers of a light vertex that an eye vertex at `depth` draws, one of `draws`.
template <class Points = IndependentPoints>
AMBILUX_HD Uint4 cache_draw(const RngKey& key, uint32_t depth, uint32_t draw, uint32_t draws = kMaxCacheDraws) {
    return Points::bits(key, 0x10000u + depth * kMaxCacheDraws, draw, draws);
}

}  // namespace ambilux
