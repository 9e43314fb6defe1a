// Batches of whole passes: parts of a render whose errors are recorded apart, so that their scatter is measured and not
// assumed.
#pragma once

#include "experiments/config.h"
#include "experiments/drive.h"
#include "experiments/results.h"
#include "film/image.h"
#include "film/moments.h"

namespace ambilux {

/// Of a render: enough to resample, few enough to cost little.
constexpr int kBatches = 16;

/// `checkpoint`, or the end of the batch after `at` if that comes sooner by half a batch or more.
Budget batch_end(const ExperimentConfig& config, const RenderPosition& at, const Budget& checkpoint);

/// The error of a batch's own image. Scene, run, seed and place are left to the caller.
BatchRow measure_batch(const FilmMoments& film, const Reference& reference, double seconds);

}  // namespace ambilux
