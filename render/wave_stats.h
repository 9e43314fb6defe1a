// From the records that stages keep to the statistics of a render.
#pragma once

#include <vector>

#include "queues/layout.h"
#include "render/renderer.h"
#include "stages/stage.h"

namespace ambilux {

/// Adds one set of kStageCount records to another.
void add_records(StageRecord* to, const StageRecord* from);

/// What a PathPolicy or BidirectionalPolicy fuses.
template <class Policy>
Fuse fuse_of(const Policy& policy) {
    return !policy.fuse ? Fuse::none : policy.connect_in_shade ? Fuse::all : Fuse::light;
}

/// Fills stages, rays and invalid counts. Stages that were never launched are left out.
void fill_stage_stats(const StageRecord* records, RenderStats& stats);

/// Fills the queues: the largest peak and all losses over `sets` sets of counters.
void fill_queue_stats(const Layout& layout, const std::vector<const QueueCounter*>& sets, RenderStats& stats);

/// Throws Error(device) that names the ways out if `needed` bytes for a wave of `paths` are more than are free.
void check_memory(uint64_t needed, uint64_t free, uint32_t paths);

/// Samples of every pixel that take about 0.2 s, from what was measured so far; 1 when nothing was.
uint32_t batch_of(double seconds, uint64_t samples);

/// The same in whole waves of `wave_samples` samples, at least one: the last depths of a wave cost as much for few
/// paths as for many.
inline uint32_t whole_waves(uint32_t batch, uint32_t wave_samples) {
    return (batch + wave_samples - 1) / wave_samples * wave_samples;
}

}  // namespace ambilux
