// Heuristics of multiple importance sampling (Veach 1997, section 9.2). A weight is 1 / (1 + the sum over the other
// strategies of (their density / this one's)^beta): a heuristic is the function term(), which must be multiplicative,
// since sums along subpaths multiply terms of ratios.
#pragma once

#include "core/math.h"

namespace ambilux {

struct BalanceHeuristic {
    static constexpr const char* kName = "balance";
    AMBILUX_HD static float term(float ratio) { return ratio; }
};

struct PowerHeuristic {
    static constexpr const char* kName = "power";
    AMBILUX_HD static float term(float ratio) { return ratio * ratio; }
};

/// All heuristics, in the order of MisHeuristic.
template <class... H>
struct HeuristicList {
    static constexpr const char* kNames[] = {H::kName...};

    AMBILUX_HD static float term(uint32_t which, float ratio) {
        float result = 0.0f;
        uint32_t k = 0;
        (void)((k++ == which && ((result = H::term(ratio)), true)) || ...);
        return result;
    }
};
using Heuristics = HeuristicList<BalanceHeuristic, PowerHeuristic>;

/// Index in Heuristics.
enum class MisHeuristic : uint32_t { balance, power };

AMBILUX_HD float heuristic_term(MisHeuristic heuristic, float ratio) {
    return Heuristics::term(uint32_t(heuristic), ratio);
}

/// Weight of a strategy whose others have `ratio`: the sum of the terms of their densities over this one's.
AMBILUX_HD float mis_weight(float ratio) { return 1.0f / (1.0f + ratio); }

}  // namespace ambilux
