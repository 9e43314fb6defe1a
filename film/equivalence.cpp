#include "film/equivalence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/distributions.h"
#include "core/error.h"
#include "film/block_sums.h"

namespace ambilux {
namespace {

/// Difference of the sums of a block and the half width of its one-sided interval.
struct Difference {
    double value = 0, half = 0, events = 0;
};

Difference difference(const BlockSum& a, const BlockSum& b, double level) {
    const double variance = a.variance + b.variance;
    const double dof = variance * variance / (a.dof_terms + b.dof_terms);
    const double half = variance > 0 ? student_tail_inverse(level, dof) * std::sqrt(variance) : 0;
    return {a.mean - b.mean, half, std::min(a.events, b.events)};
}

class Blocks {
public:
    Blocks(const Estimate& a, const Estimate& b, const EquivalenceOptions& options) : a_(a), b_(b), o_(options) {}

    Equivalence run() {
        r_.level = o_.level;
        r_.shown = true;
        whole();
        const uint32_t size = std::max(1u, o_.size);
        for (uint32_t y = 0; y < a_.height; y += size)
            for (uint32_t x = 0; x < a_.width; x += size)
                block({x, y, std::min(size, a_.width - x), std::min(size, a_.height - y)});
        r_.shown = r_.shown && r_.mean_bound < o_.mean && r_.block_bound < o_.block;
        return r_;
    }

private:
    void whole() {
        // Channels of a pixel may be fully correlated: half widths add.
        const Rectangle all{0, 0, a_.width, a_.height};
        double value = 0, half = 0;
        for (uint32_t c = 0; c < 3; ++c) {
            const BlockSum b = block_sum(b_, all, c);
            const Difference d = difference(block_sum(a_, all, c), b, o_.level);
            value += d.value;
            half += d.half;
            brightness_ += b.mean;
        }
        r_.mean_bound = brightness_ > 0 ? (std::abs(value) + half) / brightness_ : kNone;
        brightness_ /= double(uint64_t(a_.width) * a_.height);
    }

    void block(const Rectangle& area) {
        BlockSum b[3];
        double brightness = 0;
        for (uint32_t c = 0; c < 3; ++c) {
            b[c] = block_sum(b_, area, c);
            brightness += b[c].mean;
        }
        const double pixels = double(uint64_t(area.width) * area.height);
        const double unit = std::max(brightness, o_.floor * brightness_ * pixels) / 3;
        for (uint32_t c = 0; c < 3; ++c) {
            const Difference d = difference(block_sum(a_, area, c), b[c], o_.level);
            const double bound = (std::abs(d.value) + d.half) / unit;
            // Of a black block on both sides nothing was met, and nothing differs.
            if (d.half > 0 && d.events < o_.min_events) r_.shown = false;
            if (std::isnan(bound)) r_.shown = false;
            if (bound > r_.block_bound) r_.block_bound = bound, r_.worst_x = area.x, r_.worst_y = area.y;
        }
    }

    static constexpr double kNone = std::numeric_limits<double>::infinity();
    const Estimate &a_, &b_;
    const EquivalenceOptions& o_;
    Equivalence r_;
    double brightness_ = 0;  ///< of a pixel of `b`, sum of its channels
};

}  // namespace

Equivalence equivalence(const Estimate& a, const Estimate& b, const EquivalenceOptions& options) {
    if (a.width != b.width || a.height != b.height)
        throw Error(ExitCode::bad_input,
                    fmt::format("images differ in size: {}x{} and {}x{}", a.width, a.height, b.width, b.height));
    return Blocks(a, b, options).run();
}

}  // namespace ambilux
