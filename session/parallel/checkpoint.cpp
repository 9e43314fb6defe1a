#include "session/parallel/checkpoint.h"

#include <filesystem>

namespace ambilux {
namespace {

/// The films of a tree one below the other, as one film.
RenderState stacked(const MergeTree& tree, nlohmann::json notes) {
    RenderState state;
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

nlohmann::json CheckpointFile::read(MergeTree& tree) const {
    std::optional<RenderState> state = read_state(path_);
    if (!state) return nullptr;
    tree = unstacked(*state);
    return std::move(state->notes);
}

void CheckpointFile::write(const MergeTree& tree, nlohmann::json notes) {
    wait();
    writing_ = std::async(std::launch::async,
                          [path = path_, state = stacked(tree, std::move(notes))] { write_state(path, state); });
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
