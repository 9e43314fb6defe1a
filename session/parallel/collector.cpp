#include "session/parallel/collector.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

namespace ambilux {

unsigned default_block_nodes(int ranks) {
    // Below, the first rank has time enough (docs/scaling.md), and a killed rank costs the others nothing.
    constexpr int kFewRanks = 16;
    return ranks < kFewRanks ? 1 : std::bit_floor(unsigned(std::sqrt(double(ranks))));
}

int collector_of(const RangeNode& block, const RangeNode& node, int ranks) {
    return node == block || ranks < 2 ? 0 : 1 + int(block.index % uint64_t(ranks - 1));
}

std::vector<MergeTree::Entry> Collector::add(const RangeNode& block, const RangeNode& node, FilmMoments film) {
    const auto found = blocks_.try_emplace(block.first(), Block{{}, block.end() - block.first()}).first;
    Block& b = found->second;
    b.films.add(node, std::move(film));
    b.missing -= node.end() - node.first();
    spare_ = b.films.take_spare();
    if (b.missing > 0 && !last_) return {};
    std::vector<MergeTree::Entry> whole = b.films.take_entries();
    blocks_.erase(found);
    return whole;
}

std::vector<MergeTree::Entry> Collector::hand_over(bool last) {
    last_ |= last;
    std::vector<MergeTree::Entry> all;
    for (auto& [first, block] : blocks_) std::ranges::move(block.films.take_entries(), std::back_inserter(all));
    return all;
}

}  // namespace ambilux
