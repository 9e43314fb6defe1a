#include "render/invalid_watch.h"

#include "core/flag.h"

namespace ambilux {

uint32_t InvalidWatch::render(uint32_t first, uint32_t count, const volatile bool* interrupt) {
    const uint32_t done = renderer_->render(first, count, interrupt);
    InvalidBatch batch = {first, done, news()};
    if (!batch.by_stage.empty() && batches_.size() < kMostBatches) batches_.push_back(std::move(batch));
    return done;
}

std::map<std::string, InvalidCounts> InvalidWatch::news() {
    std::map<std::string, InvalidCounts> found;
    for (const auto& [stage, counts] : renderer_->stats().invalid_by_stage) {
        InvalidCounts& before = counted_[stage];
        const InvalidCounts more = {counts.nan - before.nan, counts.inf - before.inf, counts.negative - before.negative,
                                    0};
        if (more.total()) found[stage] = more;
        before = counts;
    }
    return found;
}

std::vector<InvalidBatch> InvalidWatch::samples(const InvalidBatch& batch, size_t most,
                                                const volatile bool* interrupt) {
    const uint32_t k = iteration_samples();
    if (batch.count == k) return {batch};
    std::vector<InvalidBatch> found;
    for (uint32_t s = 0; s < batch.count && found.size() < most; s += k) {
        if (is_set(interrupt) || renderer_->render(batch.first + s, k, interrupt) == 0) break;
        InvalidBatch one = {batch.first + s, k, news()};
        if (!one.by_stage.empty()) found.push_back(std::move(one));
    }
    return found;
}

}  // namespace ambilux
