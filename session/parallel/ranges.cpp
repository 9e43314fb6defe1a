#include "session/parallel/ranges.h"

#include <algorithm>
#include <bit>
#include <limits>

namespace ambilux {
namespace {

constexpr uint64_t kMostSamples = std::numeric_limits<uint32_t>::max();
constexpr uint64_t kUsualRanges = 128;
/// Paths of a range at least: a second or so of a device, a few tenths of it of a core.
constexpr uint64_t kLeastPathsCuda = 1u << 26, kLeastPathsCpu = 1u << 17;

}  // namespace

uint64_t Ranges::count() const { return ((samples ? samples : kMostSamples) + size - 1) / size; }

uint32_t Ranges::length(uint64_t range) const {
    return uint32_t(std::min<uint64_t>(size, (samples ? samples : kMostSamples) - range * size));
}

uint32_t default_range_size(uint64_t samples, uint64_t pixels, bool cuda) {
    const auto divided = [](uint64_t a, uint64_t b) { return (a + b - 1) / b; };
    const uint64_t large_enough = divided(cuda ? kLeastPathsCuda : kLeastPathsCpu, std::max<uint64_t>(1, pixels));
    const uint64_t cheap_films = cuda ? std::min<uint64_t>(256, divided(samples, 32)) : 1;
    return uint32_t(std::min(std::max({divided(samples, kUsualRanges), large_enough, cheap_films}),
                             std::max<uint64_t>(1, samples)));
}

Dealer::Dealer(const Ranges& ranges, double seconds, const MergeTree& done, unsigned nodes)
    : ranges_(ranges), seconds_(seconds), nodes_(nodes) {
    for (const auto& [first, entry] : done.entries()) done_[first] = entry.node.end();
}

uint64_t Dealer::open() const {
    uint64_t ranges = ranges_.count() - std::min(at_, ranges_.count());
    for (auto node = done_.lower_bound(at_); node != done_.end(); ++node)
        ranges -= std::min(node->second, ranges_.count()) - node->first;
    return ranges;
}

std::optional<RangeNode> Dealer::next(double elapsed, double per_range, double rate, size_t devices) {
    const auto together = double(devices);
    for (auto done = done_.find(at_); done != done_.end(); done = done_.find(at_)) at_ = done->second;
    if (at_ >= ranges_.count()) return std::nullopt;
    double wanted = together * (per_range > 0 ? node_seconds_ / per_range : 1);
    if (seconds_ > 0) {
        const double left = seconds_ - elapsed;
        if (left <= 0 || left < 0.5 * per_range) return std::nullopt;
        if (per_range > 0) wanted = std::min(wanted, together * left / per_range);
    }
    // Half of what the time that is left allows, so that whoever is late holds up the others by little.
    if (ranges_.samples && per_range > 0 && rate > 0)
        wanted = std::min(wanted, 0.5 * together * double(open()) / rate / per_range);
    const auto after = done_.lower_bound(at_);
    const uint64_t end = after == done_.end() ? ranges_.count() : std::min(ranges_.count(), after->first);
    if (at_ >= block_end_) {
        block_ = cut(wanted * nodes_, end);
        block_end_ = block_.end();
    }
    const RangeNode node = cut(wanted, block_end_);
    at_ = node.end();
    return node;
}

/// A node that begins where the next range is and ends by `end`, of `wanted` ranges at most.
RangeNode Dealer::cut(double wanted, uint64_t end) const {
    const auto most = uint64_t(std::clamp(wanted, 1.0, double(end - at_)));
    const uint64_t aligned = at_ ? at_ & (~at_ + 1) : most;  // the largest power of two that divides it
    const auto level = uint32_t(std::countr_zero(std::min(std::bit_floor(most), aligned)));
    return {level, at_ >> level};
}

}  // namespace ambilux
