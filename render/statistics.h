// From the records that stages keep to the statistics of a render.
#pragma once

#include <string>
#include <vector>

#include "core/seconds.h"
#include "queues/layout.h"
#include "render/renderer.h"

namespace ambilux {

/// Fills stages, rays and invalid counts from one record for each name. Stages that did nothing are left out; the
/// others stand in the order of a wave: light subpaths, eye subpaths, connections, mis_weight to update_film.
void fill_stage_stats(const std::vector<std::string>& names, const std::vector<StageRecord>& records,
                      RenderStats& stats);

/// Fills the queues: the largest peak and all losses over `sets` sets of counters.
void fill_queue_stats(const Layout& layout, const std::vector<const QueueCounter*>& sets, RenderStats& stats);

/// Sums of StrategyFilm for `images` of `pixels`.
inline uint64_t strategy_values(uint32_t images, uint64_t pixels) { return uint64_t(images) * 2 * pixels * 3; }
/// Means of what they gathered. As many of `dropped` as images.
std::vector<StrategyImage> strategy_images(uint32_t max_depth, uint64_t samples, const std::vector<double>& sums,
                                           const std::vector<uint64_t>& dropped);

/// Samples of every pixel that take about 0.2 s, from what was measured so far; 1 when nothing was.
uint32_t batch_of(double seconds, uint64_t samples);

}  // namespace ambilux
