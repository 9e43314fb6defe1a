// What the state of a method depends on.
#pragma once

#include <cstdint>

namespace ambilux {

/// What a method keeps from iteration to iteration, and so what may go on from it.
enum class StateKind : uint32_t {
    none,        ///< nothing outlives an iteration
    by_index,    ///< follows from the number of the iteration: the same on every device
    per_device,  ///< follows from the samples of its device: each device has one, and it is saved with the film
};

}  // namespace ambilux
