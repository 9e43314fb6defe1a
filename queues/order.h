// Where items of a queue lie and in which order a stage goes through them: two switches for ablation. Both come down to
// a list of places.
#pragma once

#include "queues/layout.h"

namespace ambilux {

/// How gaps between items, which paths leave that have ended, are closed.
enum class Compaction : uint32_t {
    atomic,  ///< items are appended
    select,  ///< items lie at the places of their paths; a scan makes a list of those that hold one
    none,    ///< items lie at the places of their paths; stages go through all places and skip the empty ones
};

/// What a stage's items are sorted by before it.
enum class Ordering : uint32_t {
    none,
    material,   ///< hits by the material that they will be shaded with
    morton,     ///< rays by octant of direction, then along a Z curve by origin
    automatic,  ///< none or material, whichever is known to be faster (make_renderer)
};

inline const char* compaction_name(Compaction c) {
    return c == Compaction::atomic ? "atomic" : c == Compaction::select ? "select" : "none";
}
inline const char* ordering_name(Ordering o) {
    return o == Ordering::none       ? "none"
           : o == Ordering::material ? "material"
           : o == Ordering::morton   ? "morton"
                                     : "auto";
}

struct QueuePolicy {
    Compaction compaction = Compaction::atomic;
    Ordering ordering = Ordering::none;
    bool keyed_hits = false;  ///< ordering by material: hits are kept with their keys (Queue::keys)

    /// For queues of which a path has one item at a time; others are always appended to.
    bool fixed_places() const { return compaction != Compaction::atomic; }
};

/// Memory of the lists, one at a time. `slots`: the most items that a list can hold.
struct OrderMemory {
    QueuePolicy policy;
    uint32_t slots;
    uint32_t* list[2];  ///< places: those selected, or all one after the other; and the same sorted. The second, and
                        ///< keys, for sorting only
    uint32_t* keys[2];
    std::byte* temporary;  ///< what a backend's scans and sorts need
    uint64_t temporary_bytes;
};

inline OrderMemory lay_out_order(Layout& layout, QueuePolicy policy, uint32_t slots, uint64_t temporary_bytes = 0) {
    const bool sorts = policy.ordering != Ordering::none;
    OrderMemory m{};
    m.policy = policy;
    m.slots = slots;
    m.list[0] = layout.allocate<uint32_t>(sorts || policy.compaction == Compaction::select ? slots : 0);
    m.list[1] = layout.allocate<uint32_t>(sorts ? slots : 0);
    for (uint32_t*& keys : m.keys) keys = layout.allocate<uint32_t>(sorts ? slots : 0);
    m.temporary = layout.allocate<std::byte>(temporary_bytes);
    m.temporary_bytes = temporary_bytes;
    return m;
}

}  // namespace ambilux
