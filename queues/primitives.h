// Memory of sorts and scans, which executors run: CUB's on a device, TBB's and the standard library's on a host.
#pragma once

#include "core/hd.h"
#include "queues/layout.h"

namespace ambilux {

/// Bytes that the primitives of a backend need beside what they read and write.
struct PrimitiveBytes {
    uint64_t (*sort_pairs)(uint32_t items, uint32_t key_bytes);
    uint64_t (*scan)(uint32_t items);
};

/// Pairs of a key (16, 32 or 64 bits) and a value: in [0] before a sort, in [1] after it, in the order of their keys,
/// equal keys in the order that they had.
template <class Key>
struct SortMemory {
    Key* keys[2];
    uint32_t* values[2];
    std::byte* temporary;
    uint64_t temporary_bytes;
    uint32_t capacity;  ///< pairs

    static SortMemory lay_out(Layout& layout, uint32_t capacity, const PrimitiveBytes& primitives) {
        SortMemory m{};
        for (Key*& keys : m.keys) keys = layout.allocate<Key>(capacity);
        for (uint32_t*& values : m.values) values = layout.allocate<uint32_t>(capacity);
        m.temporary_bytes = primitives.sort_pairs(capacity, sizeof(Key));
        m.temporary = layout.allocate<std::byte>(m.temporary_bytes);
        m.capacity = capacity;
        return m;
    }
};

/// Sums of all numbers before each of `in`; may be the same array.
struct ScanMemory {
    std::byte* temporary;
    uint64_t temporary_bytes;

    static ScanMemory lay_out(Layout& layout, uint32_t items, const PrimitiveBytes& primitives) {
        const uint64_t bytes = primitives.scan(items);
        return {layout.allocate<std::byte>(bytes), bytes};
    }
};

/// The first of `count` sorted keys that is no less than `key`.
template <class Key>
AMBILUX_HD uint32_t lower_bound(const Key* keys, uint32_t count, Key key) {
    uint32_t begin = 0, end = count;
    while (begin < end) {
        const uint32_t middle = begin + (end - begin) / 2;
        if (keys[middle] < key)
            begin = middle + 1;
        else
            end = middle;
    }
    return begin;
}

}  // namespace ambilux
