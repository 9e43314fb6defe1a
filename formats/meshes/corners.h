// Corners of faces, which become vertices: equal ones share one.
#pragma once

#include <cstdint>
#include <unordered_map>

namespace ambilux {

/// A vertex, and what the corner has beside its place: indices, or the bits of numbers.
struct Corner {
    uint32_t v, vt, vn;
    bool operator==(const Corner&) const = default;
};

struct CornerHash {
    size_t operator()(const Corner& c) const {
        const uint64_t h = c.v * 0x9E3779B97F4A7C15ull ^ c.vt * 0xC2B2AE3D27D4EB4Full ^ c.vn * 0x165667B19E3779F9ull;
        return h ^ h >> 29;
    }
};

using CornerMap = std::unordered_map<Corner, uint32_t, CornerHash>;

}  // namespace ambilux
