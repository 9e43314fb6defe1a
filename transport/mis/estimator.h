// Estimators of the path tracer.
#pragma once

#include <cstdint>

namespace ambilux {

/// Strategies of the path tracer: hits only, next event estimation wherever it can find the light, both with weights.
enum class Estimator : uint32_t { naive, nee, mis };

}  // namespace ambilux
