// The state of a render by ranges: whoever rendered which, any number of devices and ranks goes on from it.
#pragma once

#include <future>

#include "film/merge_tree.h"
#include "session/state.h"

namespace ambilux {

/// Writes states while the render goes on.
class CheckpointFile {
public:
    explicit CheckpointFile(std::string path) : path_(std::move(path)) {}

    bool exists() const;
    /// Notes of the state, and `tree` and `devices` filled; null if there is none or it is damaged (read_state).
    nlohmann::json read(MergeTree& tree, DeviceStates& devices) const;
    /// Throws Error(bad_input) that names what differs if notes of the state are those of another render. `range_size`:
    /// 0 agrees with any.
    void check_same(const nlohmann::json& notes, const nlohmann::json& identity, uint32_t range_size) const;
    /// Begins to write; waits for an earlier one to end.
    void write(const MergeTree& tree, nlohmann::json notes, DeviceStates devices);
    /// Throws what writing threw.
    void wait();
    void remove();
    const std::string& path() const { return path_; }

private:
    const std::string path_;
    std::future<void> writing_;
};

}  // namespace ambilux
