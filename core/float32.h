// Floats as a scene stores them.
#pragma once

namespace ambilux {

/// Number of a table or texel: 32 bits also where code is compiled in double precision (cmake/double_precision.cmake).
using float32 = float;

}  // namespace ambilux
