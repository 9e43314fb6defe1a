// Heuristics of multiple importance sampling (Veach 1997, section 9.2). A weight is 1 / (1 + the sum over the other
// strategies of (their density / this one's)^beta). A heuristic is two functions: term(ratio) = ratio^beta, and
// norm(a, b) = (a^beta + b^beta)^(1/beta). Subpaths carry norms, not sums of powers: they have the range of the ratios
// themselves, where a squared density overflows from lengths of 1e9 on.
#pragma once

#include <concepts>

#include "core/math.h"
#include "transport/mis/heuristic_name.h"

namespace ambilux {

/// What a member of Heuristics has. HeuristicList says which of it is missing.
template <class H>
concept Heuristic = requires(float x) {
    { (H::kName) } -> std::same_as<const char* const&>;
    { H::term(x) } -> std::same_as<float>;
    { H::norm(x, x) } -> std::same_as<float>;
};

struct BalanceHeuristic {
    static constexpr const char* kName = "balance";
    AMBILUX_HD static float term(float ratio) { return ratio; }
    AMBILUX_HD static float norm(float a, float b) { return a + b; }
};

struct PowerHeuristic {
    static constexpr const char* kName = "power";
    AMBILUX_HD static float term(float ratio) { return ratio * ratio; }
    /// Neither overflows nor underflows where the result does not. Relative error of 5 roundings.
    AMBILUX_HD static float norm(float a, float b) {
        const float large = max(a, b), small = min(a, b);
        return small > 0.0f && large < kInfinity ? large * sqrtf(1.0f + sqr(small / large)) : large;
    }
};

/// All heuristics, in the order of MisHeuristic.
template <class... H>
struct HeuristicList {
    static_assert((requires { (H::kName)[0]; } && ...), "a heuristic lacks kName, its name in settings");
    static_assert((requires(float ratio) { H::term(ratio); } && ...), "a heuristic lacks term(ratio)");
    static_assert((requires(float a) { H::norm(a, a); } && ...), "a heuristic lacks norm(a, b)");
    static_assert((Heuristic<H> && ...), "kName is a const char*, term and norm take and return float");

    static constexpr const char* kNames[] = {H::kName...};

    AMBILUX_HD static float term(uint32_t which, float ratio) {
        float result = 0.0f;
        uint32_t k = 0;
        (void)((k++ == which && ((result = H::term(ratio)), true)) || ...);
        return result;
    }
    AMBILUX_HD static float norm(uint32_t which, float a, float b) {
        float result = 0.0f;
        uint32_t k = 0;
        (void)((k++ == which && ((result = H::norm(a, b)), true)) || ...);
        return result;
    }
};
using Heuristics = HeuristicList<BalanceHeuristic, PowerHeuristic>;

AMBILUX_HD float heuristic_term(MisHeuristic heuristic, float ratio) {
    return Heuristics::term(uint32_t(heuristic), ratio);
}
AMBILUX_HD float heuristic_norm(MisHeuristic heuristic, float a, float b) {
    return Heuristics::norm(uint32_t(heuristic), a, b);
}

/// Weight of a strategy whose others have `ratio`: the sum of the terms of their densities over this one's.
AMBILUX_HD float mis_weight(float ratio) { return 1.0f / (1.0f + ratio); }

}  // namespace ambilux
