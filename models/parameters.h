// Parameters of models as a scene has them.
#pragma once

#include "core/vec.h"

namespace ambilux {

constexpr uint32_t kNone = 0xffffffffu;

/// Colour parameter: `value`, or texture `texture` times `value` when texture >= 0.
struct ParamRgb {
    Rgb value = {0, 0, 0};
    int32_t texture = -1;
};

/// Scalar parameter: `value`, or the luminance of the texture times `value`.
struct ParamFloat {
    float value = 0;
    int32_t texture = -1;
};

}  // namespace ambilux
