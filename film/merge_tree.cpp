#include "film/merge_tree.h"

#include <iterator>

#include "core/error.h"

namespace ambilux {

void MergeTree::add(RangeNode node, FilmMoments film) {
    if (next(node.first()) < node.end() || has(node.first()))
        throw Error(ExitCode::device, "samples of range " + std::to_string(node.first()) + " were rendered twice");
    samples_ += film.samples;
    for (;;) {
        const RangeNode sibling = {node.level, node.index ^ 1};
        const auto other = entries_.find(sibling.first());
        if (other == entries_.end() || other->second.node != sibling) break;
        // a + b is b + a, bit by bit.
        film.add(other->second.film);
        spare_ = std::move(other->second.film);
        entries_.erase(other);
        node = {node.level + 1, node.index >> 1};
    }
    entries_.emplace(node.first(), Entry{node, std::move(film)});
}

bool MergeTree::has(uint64_t range) const {
    const auto after = entries_.upper_bound(range);
    return after != entries_.begin() && std::prev(after)->second.node.end() > range;
}

uint64_t MergeTree::next(uint64_t range) const {
    if (has(range)) return range;
    const auto after = entries_.lower_bound(range);
    return after == entries_.end() ? UINT64_MAX : after->first;
}

FilmMoments MergeTree::sum() const {
    // The last range has no sibling until its ancestor has: from the end on, each film is the second half of a node.
    FilmMoments sum;
    for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) sum.add(entry->second.film);
    return sum;
}

FilmMoments MergeTree::take_sum() {
    FilmMoments taken = entries_.size() == 1 ? std::move(entries_.begin()->second.film) : sum();
    *this = {};
    return taken;
}

std::vector<MergeTree::Entry> MergeTree::take_entries() {
    std::vector<Entry> taken;
    for (auto& [first, entry] : entries_) taken.push_back(std::move(entry));
    *this = {};
    return taken;
}

}  // namespace ambilux
