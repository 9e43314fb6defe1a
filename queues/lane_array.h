// Items as lanes of 16 bytes, so that neighbouring threads load and store neighbouring 16-byte words.
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include "core/lane.h"

namespace ambilux {

/// Lanes of an item, the first ones, that lie two by two where the others are apart, since memory moves 32 bytes at
/// least: items say so (kPairedLanes) that are written in order and read in another, sorted by their materials or
/// drawn.
template <class Item>
constexpr uint32_t paired_lanes() {
    if constexpr (requires { Item::kPairedLanes; }) {
        static_assert(Item::kPairedLanes % 2 == 0 && Item::kPairedLanes <= sizeof(Item) / sizeof(Lane));
        return Item::kPairedLanes;
    }
    return 0;
}

/// Array of trivially copyable items: lane k of item i is at base[k * capacity + i] but for paired ones. A view: copies
/// share the storage.
template <class Item>
struct LaneArray {
    static_assert(std::is_trivially_copyable_v<Item> && sizeof(Item) % sizeof(Lane) == 0,
                  "items are whole lanes of plain data");
    static constexpr uint32_t kLanes = sizeof(Item) / sizeof(Lane);

    Lane* base = nullptr;
    uint32_t capacity = 0;

    AMBILUX_HD size_t place(uint32_t i, uint32_t lane) const {
        return lane + 1 <= paired_lanes<Item>() ? size_t(lane & ~1u) * capacity + 2 * size_t(i) + (lane & 1u)
                                                : size_t(lane) * capacity + i;
    }

    /// `lanes`: of the item, the first ones; the others are zero.
    AMBILUX_HD Item load(uint32_t i, uint32_t lanes = kLanes) const { return load_but(i, kLanes, {}, lanes); }
    /// Lane `known` is `value`, and what is in memory is not looked at.
    AMBILUX_HD Item load_but(uint32_t i, uint32_t known, const Lane& value, uint32_t lanes = kLanes) const {
        Lane all[kLanes];
        for (uint32_t k = 0; k < kLanes; ++k) {
            all[k] = value;
            if (k != known && k < lanes) all[k] = base[place(i, k)];
        }
        Item item;
        memcpy(&item, all, sizeof(Item));
        return item;
    }
    /// Lanes of an item from `first` to before `end`; what else `item` has stays as it is.
    AMBILUX_HD void load_more(uint32_t i, Item& item, uint32_t first, uint32_t end) const {
        Lane all[kLanes];
        memcpy(all, &item, sizeof(Item));
        for (uint32_t k = 0; k < kLanes; ++k)
            if (k >= first && k < end) all[k] = base[place(i, k)];
        memcpy(&item, all, sizeof(Item));
    }
    /// The first member of an item, which is some lanes long.
    AMBILUX_HD auto load_front(uint32_t i) const {
        using Front = decltype(Item::front);
        static_assert(offsetof(Item, front) == 0 && sizeof(Front) % sizeof(Lane) == 0);
        Lane lanes[sizeof(Front) / sizeof(Lane)];
        for (uint32_t k = 0; k < sizeof(Front) / sizeof(Lane); ++k) lanes[k] = base[place(i, k)];
        Front front;
        memcpy(&front, lanes, sizeof(Front));
        return front;
    }
    /// `lanes`: of the item, the first ones; the others stay as they are.
    AMBILUX_HD void store(uint32_t i, const Item& item, uint32_t lanes = kLanes) const {
        store_but(i, kLanes, item, lanes);
    }
    /// The same without lane `known`.
    AMBILUX_HD void store_but(uint32_t i, uint32_t known, const Item& item, uint32_t lanes = kLanes) const {
        Lane all[kLanes];
        memcpy(all, &item, sizeof(Item));
        for (uint32_t k = 0; k < kLanes; ++k)
            if (k != known && k < lanes) base[place(i, k)] = all[k];
    }
    /// The last lane of an item, by itself.
    template <class Last>
    AMBILUX_HD void store_last(uint32_t i, const Last& last) const {
        static_assert(sizeof(Last) == sizeof(Lane));
        set_start(base[place(i, kLanes - 1)], last);
    }
    template <class Last>
    AMBILUX_HD Last load_last(uint32_t i) const {
        return start_of<Last>(base[place(i, kLanes - 1)]);
    }
};

}  // namespace ambilux
