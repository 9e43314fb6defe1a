#include "session/parallel/checkpoint.h"

#include <fmt/format.h>

#include <filesystem>

#include "core/error.h"

namespace ambilux {
namespace {

/// The films of a tree one below the other, as one film.
RenderState stacked(const MergeTree& tree, nlohmann::json notes, DeviceStates devices) {
    RenderState state;
    state.devices = std::move(devices);
    notes["nodes"] = nlohmann::json::array();
    for (const auto& [first, entry] : tree.entries()) {
        const FilmMoments& film = entry.film;
        notes["nodes"].push_back({entry.node.level, entry.node.index, film.samples});
        FilmMoments& all = state.moments;
        all.width = film.width;
        all.height += film.height;
        all.samples += film.samples;
        all.sum.insert(all.sum.end(), film.sum.begin(), film.sum.end());
        all.sum_squares.insert(all.sum_squares.end(), film.sum_squares.begin(), film.sum_squares.end());
    }
    state.notes = std::move(notes);
    return state;
}

MergeTree unstacked(const RenderState& state) {
    MergeTree tree;
    const auto& nodes = state.notes.at("nodes");
    if (nodes.empty()) return tree;
    const FilmMoments& all = state.moments;
    const auto height = uint32_t(all.height / nodes.size());
    const auto values = std::ptrdiff_t(all.sum.size() / nodes.size());
    std::ptrdiff_t at = 0;
    for (const auto& node : nodes) {
        const auto part = [&](const std::vector<double>& v) {
            return std::vector<double>(v.begin() + at, v.begin() + at + values);
        };
        tree.add({node.at(0), node.at(1)}, {all.width, height, node.at(2), part(all.sum), part(all.sum_squares)});
        at += values;
    }
    return tree;
}

}  // namespace

bool CheckpointFile::exists() const { return std::filesystem::exists(path_); }

nlohmann::json CheckpointFile::read(MergeTree& tree, DeviceStates& devices) const {
    std::optional<RenderState> state = read_state(path_);
    if (!state) return nullptr;
    tree = unstacked(*state);
    devices = std::move(state->devices);
    return std::move(state->notes);
}

void CheckpointFile::check_same(const nlohmann::json& notes, const nlohmann::json& identity,
                                uint32_t range_size) const {
    const auto refuse = [&](const std::string& what) {
        throw input_error(
            path_, 0, fmt::format("holds another render: its {} differs. Give another -o, or remove the file", what));
    };
    for (const char* key : {"scene_hash", "spp"})
        if (notes.at("identity").at(key) != identity.at(key)) refuse(key);
    for (const auto& [key, value] : identity.at("settings").items())
        if (notes.at("identity").at("settings").value(key, nlohmann::json()) != value) refuse(key);
    if (range_size && notes.at("range_size") != range_size) refuse("range size");
}

void CheckpointFile::write(const MergeTree& tree, nlohmann::json notes, DeviceStates devices) {
    wait();
    writing_ = std::async(
        std::launch::async,
        [path = path_, state = stacked(tree, std::move(notes), std::move(devices))] { write_state(path, state); });
}

void CheckpointFile::wait() {
    if (writing_.valid()) writing_.get();
}

void CheckpointFile::remove() {
    wait();
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
}

}  // namespace ambilux
