// Cells of vertices by place and side: leaves of a balanced k-d tree over positions and normals, of a fixed number.
#pragma once

#include <cstdint>

#include "core/vec.h"

namespace ambilux {

/// A vertex lies on the upper side of a split where its coordinate is no less than `at`.
struct DrawSplit {
    float at;
    uint32_t axis;  ///< 0 to 2: position, 3 to 5: normal
};

/// Splits in heap order: the children of split i are 2 i and 2 i + 1, the first is 1.
struct DrawTree {
    DrawSplit* splits;
    uint32_t levels;

    AMBILUX_HD uint32_t leaves() const { return 1u << levels; }
    AMBILUX_HD uint32_t leaf(Vec3f p, Vec3f n) const {
        uint32_t i = 1;
        for (uint32_t level = 0; level < levels; ++level) {
            const DrawSplit split = splits[i];
            const Vec3f v = split.axis < 3 ? p : n;
            const uint32_t c = split.axis < 3 ? split.axis : split.axis - 3;
            const float x = c == 0 ? v.x : c == 1 ? v.y : v.z;
            i = 2 * i + (x >= split.at);
        }
        return i - leaves();
    }
};

}  // namespace ambilux
