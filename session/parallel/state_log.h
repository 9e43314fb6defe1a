// What the devices of a render by ranges keep (Renderer::save_state), up to films that are there: what is saved has
// learned from no sample that a resumed render makes again.
#pragma once

#include <deque>

#include "film/merge_tree.h"
#include "session/parallel/crew.h"
#include "session/state.h"

namespace ambilux {

class StateLog {
public:
    StateLog() = default;
    /// What each device of all ranks begins with.
    explicit StateLog(DeviceStates first) : saved_(std::move(first)), later_(saved_.size()) {}

    /// Of the devices of a rank, of which `first` is the number of the first one.
    void add(size_t first, std::vector<RangeState> states);
    /// Of each device, after the last range that has none before it whose film is missing in `films`.
    const DeviceStates& saved(const MergeTree& films);

private:
    DeviceStates saved_;
    std::vector<std::deque<RangeState>> later_;  ///< by device
};

}  // namespace ambilux
