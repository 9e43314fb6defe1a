// The samples of a render in ranges with fixed bounds, and who renders which.
#pragma once

#include <algorithm>
#include <optional>

#include "film/merge_tree.h"
#include "session/drive.h"

namespace ambilux {

/// Range r holds samples [r * size, (r + 1) * size) of every pixel. Bounds follow from the render alone, never from who
/// takes part.
struct Ranges {
    uint32_t size = 1;     ///< samples; the last range may have fewer
    uint64_t samples = 0;  ///< of the render; 0: as many as its time allows

    uint64_t count() const;
    uint32_t first_sample(uint64_t range) const { return uint32_t(range * size); }
    uint32_t length(uint64_t range) const;
};

/// Samples of a range where nothing was said: about 128 ranges, none of which is too small for its device. A CUDA
/// device hands over the film after each: 256 samples, and at least 32 ranges (docs/scaling.md).
uint32_t default_range_size(uint64_t samples, uint64_t pixels, bool cuda);

/// Deals out ranges in their order. A rank gets a node of the tree at a time, so that it hands over one film for it:
/// as many ranges as take its devices about kNodeSeconds, and fewer towards the end, so that all end together. Nodes
/// are parts of a block, also a node of the tree: another rank may add up the films of a block (collector.h).
class Dealer {
public:
    static constexpr double kNodeSeconds = 2;

    /// `seconds`: the budget in time; 0: none. `done`: what an earlier part rendered. `nodes`: in a block, about.
    Dealer(const Ranges& ranges, double seconds, const MergeTree& done, unsigned nodes = 1);

    /// Seconds of a node, such that whoever adds up the films of all `parties` spends half of its time on that at most.
    static double node_seconds(size_t parties, unsigned nodes, double film_seconds) {
        return std::max(kNodeSeconds, 2 * double(parties) / nodes * film_seconds);
    }
    /// From now on, instead of kNodeSeconds.
    void set_node_seconds(double seconds) { node_seconds_ = seconds; }
    /// What `devices` devices do next, each of which needs `per_range` seconds for a range (0: unknown), `elapsed`
    /// seconds after the start, while all together do `rate` ranges a second. Nothing when all is dealt or there is no
    /// time for half a range.
    std::optional<RangeNode> next(double elapsed, double per_range, double rate, size_t devices = 1);
    /// Of the node that was dealt last.
    const RangeNode& block() const { return block_; }

private:
    uint64_t open() const;
    RangeNode cut(double wanted, uint64_t end) const;

    const Ranges ranges_;
    const double seconds_;
    std::map<uint64_t, uint64_t> done_;  ///< from a range to the end of its node
    const unsigned nodes_;
    uint64_t at_ = 0;
    uint64_t block_end_ = 0;
    RangeNode block_;
    double node_seconds_ = kNodeSeconds;
};

}  // namespace ambilux
