// Which stages a backend runs as parts of others: all that it decides of a schedule.
#pragma once

#include "stages/fusion.h"

namespace ambilux {

/// fuse=none: every stage is a kernel with a queue, for ablation. With kernels that hold all features only.
constexpr Fusion kNoFusion = {};
/// A device traces shadow rays in persistent kernels, and camera rays as soon as they are made.
constexpr Fusion kDeviceFusion = {.weigh = true, .connect = true, .occlude = false, .generate = true};
/// A host traces shadow rays whenever there are many, and camera rays from a queue.
constexpr Fusion kHostFusion = {.weigh = true, .connect = true, .occlude = true, .generate = false};

}  // namespace ambilux
