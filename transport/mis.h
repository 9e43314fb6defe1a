// Weights of two strategies that can both sample the same path (Veach 1997, section 9.2).
#pragma once

#include "core/math.h"

namespace ambilux {

enum class MisHeuristic : uint32_t { balance, power };

/// p / (p + q). 1 when q is 0: no other strategy finds the path. Densities that are no numbers give a weight that is
/// none.
AMBILUX_HD float balance_weight(float p, float q) { return q == 0.0f ? 1.0f : 1.0f / (1.0f + q / p); }

/// p² / (p² + q²), by the ratio so that squares do not overflow.
AMBILUX_HD float power_weight(float p, float q) { return q == 0.0f ? 1.0f : 1.0f / (1.0f + sqr(q / p)); }

}  // namespace ambilux
