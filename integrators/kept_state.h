// What a method keeps from iteration to iteration: a table that it learns, a radius, photons of the iteration at work.
#pragma once

#include <concepts>
#include <cstdint>

#include "integrators/state_kind.h"
#include "queues/primitives.h"

namespace ambilux {

/// How much a state holds.
struct StateSize {
    uint32_t appended;  ///< items that all waves of an iteration append
    PrimitiveBytes primitives;
};

/// The first `lanes` lanes of the first `items` of an array that had too little room (AppendedState).
template <class Item, class Copy>
void take_lanes(LaneArray<Item> to, LaneArray<Item> from, uint32_t lanes, uint32_t items, Copy copy) {
    for (uint32_t lane = 0; lane < lanes;) {
        const uint32_t together = lane < paired_lanes<Item>() ? 2 : 1;
        copy(to.base + to.place(0, lane), from.base + from.place(0, lane), uint64_t(together) * items);
        lane += together;
    }
}

/// Most methods keep nothing.
struct NoState {
    static constexpr StateKind kKind = StateKind::none;

    template <class Policy>
    static NoState lay_out(Layout&, const Policy&, const StateSize&) {
        return {};
    }
    template <class Policy, class Put>
    void init(const Policy&, Put) const {}
    template <class Visit>
    void for_each_saved(Visit) const {}
};

namespace detail {

struct AnyPut {
    template <class T, class Values>
    void operator()(T* place, const Values& values) const;
};
struct AnyCopy {
    template <class T>
    void operator()(T* to, const T* from, uint64_t count) const;
};
struct AnyVisit {
    template <class T>
    void operator()(const char* name, T* place, uint64_t count) const;
};

}  // namespace detail

/// A plain struct of places that lay_out gives it, once without memory to tell the bytes. Its memory is zero at first;
/// init puts there what is known before the first iteration. for_each_saved shows what a resumed render needs.
template <class S, class Policy>
concept KeptState =
    std::is_trivially_copyable_v<S> && requires(const S state, Layout& layout, const Policy& policy,
                                                const StateSize& size, detail::AnyPut put, detail::AnyVisit visit) {
        { S::kKind } -> std::convertible_to<StateKind>;
        { S::lay_out(layout, policy, size) } -> std::same_as<S>;
        state.init(policy, put);
        state.for_each_saved(visit);
    };

/// A state that waves append to: its queue is one that grows (Layout::growing_queue). take_items copies all that an old
/// state held before it grew, its tables too: copy(to, from, count).
template <class S>
concept AppendedState =
    requires(const S state, const S& old, uint32_t items, detail::AnyCopy copy) { state.take_items(old, items, copy); };

}  // namespace ambilux
