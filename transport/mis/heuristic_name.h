// Which heuristic of multiple importance sampling, for those who only name one.
#pragma once

#include <cstdint>

namespace ambilux {

/// Index in Heuristics (heuristic.h).
enum class MisHeuristic : uint32_t { balance, power };

}  // namespace ambilux
