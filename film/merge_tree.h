// Films of parts of a render, added up in an order that depends on their places and not on when they come.
#pragma once

#include <map>
#include <utility>

#include "film/moments.h"

namespace ambilux {

/// 2^level ranges of sample numbers, from range (index << level) on.
struct RangeNode {
    uint32_t level = 0;
    uint64_t index = 0;

    uint64_t first() const { return index << level; }
    uint64_t end() const { return (index + 1) << level; }
    bool operator==(const RangeNode&) const = default;
};

/// A binary tree over range numbers. A node is the sum of its halves; where the second half lies past the last range,
/// it is the first. Sums are made as soon as both halves are there, so that few films are kept: about as many as ranges
/// are open, and one for each bit of the number of ranges. The sums of a render are the same bits in whichever order
/// its nodes are added, and however they were cut.
class MergeTree {
public:
    /// `film`: the sums of the samples of `node`, or of those of its ranges that exist. Nodes must not overlap.
    void add(RangeNode node, FilmMoments film);

    /// True if the samples of `range` are there.
    bool has(uint64_t range) const;
    /// The first range from `range` on that is there; UINT64_MAX if none is.
    uint64_t next(uint64_t range) const;
    uint64_t samples() const { return samples_; }

    /// The sum of all. With all ranges there, that of the tree.
    FilmMoments sum() const;
    /// The same without a copy of a single film; nothing is left.
    FilmMoments take_sum();

    struct Entry {
        RangeNode node;
        FilmMoments film;
    };
    /// The sums that are kept, which the tree has no longer.
    std::vector<Entry> take_entries();
    /// The film that was last added to another one, for its memory; empty if there is none.
    FilmMoments take_spare() { return std::exchange(spare_, {}); }
    /// The sums that are kept, by their first range.
    const std::map<uint64_t, Entry>& entries() const { return entries_; }

private:
    std::map<uint64_t, Entry> entries_;
    uint64_t samples_ = 0;  ///< per pixel
    FilmMoments spare_;
};

}  // namespace ambilux
