// Russian roulette. It enters no density: the subpaths of every strategy are thinned and repaid alike, so that weights,
// which depend on the path alone, still sum to one.
#pragma once

#include "transport/subpath/subpath.h"

namespace ambilux {

/// Subpath::roulette_scale with the bits that items keep (16 of a float): every schedule then takes the same decisions.
/// Less than 2^-7 below; any value keeps roulette unbiased.
AMBILUX_HD float rounded_scale(float scale) {
    constexpr uint32_t kKept = 7;  // of the fraction
    return bits_float(float_bits(scale) & ~FloatBits(0) << (kFractionBits - kKept));
}

/// Subpath::roulette_scale of a light subpath that starts with `flux`: roulette sees what is left of it, so that
/// neither the unit of emission nor that of length decides.
AMBILUX_HD float light_roulette_scale(Rgb flux) { return rounded_scale(inverse_sqrt(max_component(flux))); }

/// Thins a subpath by the share of its throughput that is left, at most `cap`; `u` uniform in [0,1). False if it ends.
/// Radiance is scaled by the squared index of the medium, which is not loss (Mitsuba's rule).
template <class Mis>
AMBILUX_HD bool survives(Subpath<Mis>& path, float cap, float u) {
    // Scaled twice, since the square may be no float where the product is.
    const float left = max_component(path.throughput) * path.roulette_scale * path.roulette_scale;
    const float probability = min(left, cap);
    if (!(u < probability)) return false;
    path.throughput = path.throughput / probability;
    return true;
}

/// Roulette before the shadow ray: what would add less than a share `cull` of the light `so_far` that its path has
/// brought survives with the probability of its part of that share, and is worth more by the inverse. The expectation
/// stays, since `so_far` and `seed` are known before. Returns the factor, 0 for what is dropped.
AMBILUX_HD float cull_factor(float cull, Rgb value, Rgb so_far, uint32_t seed) {
    const float probability = luminance(value) / (cull * luminance(so_far));
    if (!(probability < 1.0f)) return 1.0f;
    return hash_float(seed, 0x63756c6cu) < probability ? 1.0f / probability : 0.0f;
}

}  // namespace ambilux
