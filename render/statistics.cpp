#include "render/statistics.h"

#include <algorithm>
#include <iterator>
#include <string_view>

namespace ambilux {
namespace {

/// Stages as the light goes through them (docs/architecture.md). An integrator may have others: they come before
/// mis_weight.
constexpr std::string_view kBeforeOthers[] = {"megakernel",     "light_generate",  "light_extend", "light_shade",
                                              "connect_camera", "generate",        "extend",       "shade",
                                              "connect",        "connect_vertices"};
constexpr std::string_view kAfterOthers[] = {"mis_weight", "occlude", "accumulate", "splat", "update_film"};

size_t place_in_schedule(const std::string& stage) {
    const size_t before = size_t(std::find(std::begin(kBeforeOthers), std::end(kBeforeOthers), stage) - kBeforeOthers);
    const size_t after = size_t(std::find(std::begin(kAfterOthers), std::end(kAfterOthers), stage) - kAfterOthers);
    return after < std::size(kAfterOthers) ? std::size(kBeforeOthers) + 1 + after : before;
}

}  // namespace

void fill_stage_stats(const std::vector<std::string>& names, const std::vector<StageRecord>& records,
                      RenderStats& stats) {
    for (size_t s = 0; s < names.size(); ++s) {
        const StageRecord& r = records[s];
        // A stage that runs as part of another may have no items of its own, but it drops values.
        const InvalidCounts invalid = {r.nan, r.inf, r.negative, r.underflow};
        if (invalid.total() + invalid.underflow) stats.invalid_by_stage[names[s]] = invalid;
        stats.invalid.nan += r.nan;
        stats.invalid.inf += r.inf;
        stats.invalid.negative += r.negative;
        stats.invalid.underflow += r.underflow;
        if (r.launches == 0 && r.items == 0) continue;
        StageStats stage;
        stage.name = names[s];
        stage.launches = r.launches;
        stage.items = r.items;
        stage.seconds = std::max(0.0, double(int64_t(r.nanoseconds)) * 1e-9);  // FusedClock: an estimate
        uint32_t depths = kTrackedDepths;
        while (depths > 0 && r.items_by_depth[depths - 1] == 0) --depths;
        stage.items_by_depth.assign(r.items_by_depth, r.items_by_depth + depths);
        stats.stages.push_back(stage);
        if (stage.name == "extend" || stage.name == "light_extend") stats.rays_extend += r.items;
        if (stage.name == "occlude") stats.rays_occlude += r.items;
    }
    // Names come in the order in which stages were made.
    std::stable_sort(stats.stages.begin(), stats.stages.end(), [](const StageStats& a, const StageStats& b) {
        return place_in_schedule(a.name) < place_in_schedule(b.name);
    });
}

void fill_queue_stats(const Layout& layout, const std::vector<const QueueCounter*>& sets, RenderStats& stats) {
    for (size_t q = 0; q < layout.queue_names().size(); ++q) {
        QueueStats queue;
        queue.name = layout.queue_names()[q];
        queue.capacity = layout.queue_capacities()[q];
        for (const QueueCounter* counters : sets) {
            queue.peak = std::max(queue.peak, counters[q].peak);
            queue.overflow += counters[q].overflow;
        }
        stats.queues.push_back(queue);
    }
}

std::vector<StrategyImage> strategy_images(uint32_t max_depth, uint64_t samples, const std::vector<double>& sums,
                                           const std::vector<uint64_t>& dropped) {
    std::vector<StrategyImage> images;
    const double scale = samples ? 1.0 / double(samples) : 0.0;
    const auto add = [&](uint32_t s, uint32_t t, bool merge) {
        const size_t index = images.size(), values = sums.size() / 2 / dropped.size();
        StrategyImage image = {s, t, merge, std::vector<float>(values), std::vector<float>(values), dropped[index]};
        const double* raw = sums.data() + 2 * index * values;
        for (size_t i = 0; i < values; ++i) {
            image.raw[i] = float(raw[i] * scale);
            image.weighted[i] = float(raw[values + i] * scale);
        }
        images.push_back(std::move(image));
    };
    for (uint32_t k = 1; k <= max_depth; ++k)
        for (uint32_t s = 0; s <= k; ++s) add(s, k + 1 - s, false);
    if (dropped.size() > images.size())
        for (uint32_t k = 2; k <= max_depth; ++k)
            for (uint32_t s = 2; s <= k; ++s) add(s, k + 2 - s, true);
    return images;
}

uint32_t batch_of(double seconds, uint64_t samples) {
    if (samples == 0 || !(seconds > 0)) return 1;
    return uint32_t(std::clamp(0.2 * double(samples) / seconds, 1.0, 65536.0));
}

}  // namespace ambilux
