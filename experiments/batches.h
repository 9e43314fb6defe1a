// Batches of whole passes: parts of a render whose errors are recorded apart, so that their scatter is measured and not
// assumed.
#pragma once

#include <utility>
#include <vector>

#include "experiments/config.h"
#include "experiments/results.h"
#include "film/image.h"
#include "film/moments.h"
#include "session/drive.h"

namespace ambilux {

/// Of a render: enough to resample, few enough to cost little.
constexpr int kBatches = 16;

/// `checkpoint`, or the end of the batch after `at`, in whole iterations, if that comes sooner by half a batch or more.
Budget batch_end(const ExperimentConfig& config, const RenderPosition& at, const Budget& checkpoint);

/// The budget until the first of the pending checkpoints, or the end of a batch (batch_end).
Budget next_budget(const ExperimentConfig& config, const std::vector<size_t>& pending, const RenderPosition& at);

/// Places in lists of `scenes` and `runs`: all pairs, as listed, or in an order that the seed decides.
std::vector<std::pair<size_t, size_t>> render_order(size_t scenes, size_t runs, uint64_t seed, bool random);

/// The error of a batch's own image. Scene, run, seed and place are left to the caller.
BatchRow measure_batch(const FilmMoments& film, const Reference& reference, double seconds);

}  // namespace ambilux
