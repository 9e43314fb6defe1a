// The primitives there are: the only list of them.
#pragma once

#include "models/model_list.h"

/// X(record, name): what holds it in scene/view.h, and the name in messages and files.
#define AMBILUX_PRIMITIVES(X) \
    X(Triangle, triangle)     \
    X(Quadric, sphere)        \
    X(Quadric, disk)          \
    X(Quadric, cylinder)

namespace ambilux {

AMBILUX_MODEL_ENUM(PrimitiveType, AMBILUX_PRIMITIVES)

}  // namespace ambilux
