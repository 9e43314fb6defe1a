#include "render/wave_stats.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"

namespace ambilux {

void add_records(StageRecord* to, const StageRecord* from) {
    for (uint32_t s = 0; s < kStageCount; ++s) {
        to[s].launches += from[s].launches;
        to[s].items += from[s].items;
        to[s].nanoseconds += from[s].nanoseconds;
        to[s].nan += from[s].nan;
        to[s].inf += from[s].inf;
        to[s].negative += from[s].negative;
        for (uint32_t d = 0; d < kTrackedDepths; ++d) to[s].items_by_depth[d] += from[s].items_by_depth[d];
    }
}

void fill_stage_stats(const StageRecord* records, RenderStats& stats) {
    for (uint32_t s = 0; s < kStageCount; ++s) {
        const StageRecord& r = records[s];
        if (r.launches == 0 && r.items == 0) continue;
        StageStats stage;
        stage.name = kStageNames[s];
        stage.launches = r.launches;
        stage.items = r.items;
        stage.seconds = double(r.nanoseconds) * 1e-9;
        uint32_t depths = kTrackedDepths;
        while (depths > 0 && r.items_by_depth[depths - 1] == 0) --depths;
        stage.items_by_depth.assign(r.items_by_depth, r.items_by_depth + depths);
        stats.stages.push_back(stage);
        if (r.nan + r.inf + r.negative) stats.invalid_by_stage[stage.name] = {r.nan, r.inf, r.negative};
        stats.invalid.nan += r.nan;
        stats.invalid.inf += r.inf;
        stats.invalid.negative += r.negative;
    }
    stats.rays_extend = records[uint32_t(StageId::extend)].items;
    stats.rays_occlude = records[uint32_t(StageId::occlude)].items;
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

void check_memory(uint64_t needed, uint64_t free, uint32_t paths) {
    if (needed <= free) return;
    throw Error(ExitCode::device, fmt::format("this render needs {} MiB on the device, and {} MiB are free: try a "
                                              "smaller --size or --set wave_size=N (now {} paths)",
                                              needed >> 20, free >> 20, paths));
}

uint32_t batch_of(double seconds, uint64_t samples) {
    if (samples == 0 || !(seconds > 0)) return 1;
    return uint32_t(std::clamp(0.2 * double(samples) / seconds, 1.0, 65536.0));
}

}  // namespace ambilux
