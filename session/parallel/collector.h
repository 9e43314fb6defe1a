// Where many ranks render, the first one gets films of whole blocks, which other ranks have added up.
#pragma once

#include <map>
#include <vector>

#include "film/merge_tree.h"

namespace ambilux {

/// Nodes in a block, for so many ranks: the first rank and those that collect have about as many films to add up. 1
/// where the first one does it alone.
unsigned default_block_nodes(int ranks);
/// The rank that adds up films of a block; 0: the first one does, since the block is a single node or there is no
/// other.
int collector_of(const RangeNode& block, const RangeNode& node, int ranks);

/// Films of blocks that a rank adds up for the first one.
class Collector {
public:
    /// Returns what is to be handed over: the film of a whole block, or nothing.
    std::vector<MergeTree::Entry> add(const RangeNode& block, const RangeNode& node, FilmMoments film);
    /// What there is of blocks that are not whole: a block with a slow rank in it would keep the others' films out of
    /// checkpoints. `last`: no more is dealt, and from now on films are handed over as they come.
    std::vector<MergeTree::Entry> hand_over(bool last);
    /// Memory for the next film, if there is any.
    FilmMoments take_spare() { return std::exchange(spare_, {}); }

private:
    struct Block {
        MergeTree films;
        uint64_t missing = 0;  ///< ranges
    };
    std::map<uint64_t, Block> blocks_;  ///< by their first range
    FilmMoments spare_;
    bool last_ = false;
};

}  // namespace ambilux
