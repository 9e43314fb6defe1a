// The mean of an image and how well it is known, from independent batches of samples.
#pragma once

#include <string>
#include <vector>

#include "integrators/settings.h"
#include "scene/scene.h"

namespace ambilux::stress {

/// Independent batches of equal size that a cell is rendered in.
constexpr uint32_t kBatches = 32;
/// Boxes of pixels along each side of the film that are kept apart.
constexpr uint32_t kBoxes = 4;

/// Means over pixels and channels, of every batch.
struct Batches {
    std::vector<double> boxes;  ///< batch * boxes of the film + box
    uint32_t boxes_x = 1, boxes_y = 1;
    uint64_t samples = 0;  ///< per pixel, of all batches

    uint32_t box_count() const { return boxes_x * boxes_y; }
};

struct Measurement {
    Batches batches;
    double paths = 0;                ///< samples of all pixels
    double seconds = 0;              ///< inside of the renderer, wall clock
    uint64_t invalid = 0, lost = 0;  ///< values dropped as no radiance; items that found no room in a queue
    bool interrupted = false;
};

/// When a measurement is good enough, or as good as it gets.
struct Effort {
    double relative_error = 0.002;  ///< standard error of the mean over the mean
    double paths = 4e5;             ///< at most
    double seconds = 1;             ///< at most, as far as batches allow
};

/// Renders until one of the bounds of `effort` is met. Throws Error as make_renderer does.
Measurement measure(const Scene& scene, const RenderSettings& settings, const Effort& effort,
                    const volatile bool* interrupt);

}  // namespace ambilux::stress
