// The mean of an image and how well it is known, from independent batches of samples.
#pragma once

#include <cstdint>
#include <vector>

#include "session/hooks.h"

namespace ambilux::stress {

/// Boxes of pixels along each side of the film that are kept apart.
constexpr uint32_t kBoxes = 4;

/// Independent batches of equal size that an image of so many pixels is rendered in. Large films have fewer: each batch
/// takes a whole sample of every pixel.
constexpr uint32_t batches_of(uint64_t pixels) { return pixels > 1u << 20 ? 8 : 32; }

/// A measurement whose time is over in its first round ends with as few.
constexpr uint32_t kLeastBatches = 8;

/// Means over pixels and channels, of every batch.
struct Batches {
    std::vector<double> boxes;  ///< batch * boxes of the film + box
    uint32_t boxes_x = 1, boxes_y = 1;

    uint32_t box_count() const { return boxes_x * boxes_y; }
};

struct Measurement {
    Batches batches;
    uint64_t samples = 0;            ///< of every pixel
    double paths = 0;                ///< samples of all pixels
    double seconds = 0;              ///< from the making of the renderer to its end, wall clock
    double first = 0;                ///< mean of the first round, if it is whole: the same samples on every backend
    uint64_t invalid = 0, lost = 0;  ///< values dropped as no radiance; items that found no room in a queue
    uint64_t underflow = 0;          ///< contributions that their weight took to 0
    bool interrupted = false;
};

/// When a measurement is good enough, or as good as it gets.
struct Effort {
    double relative_error = 0.002;  ///< standard error of the mean over the mean
    double paths = 4e5;             ///< at most
    double seconds = 1;             ///< at most, but for the first kLeastBatches batches
    double first_paths = 3.2e4;     ///< of the first round, over all batches
    uint64_t samples = 0;           ///< of every pixel; if not 0, neither error nor paths end the measurement before
};

/// Renders until one of the bounds of `effort` is met. Throws Error as make_renderer does, and Error(usage) for more
/// samples than a renderer can count.
Measurement measure(const Hooks& hooks, const Scene& scene, const RenderSettings& settings, const Effort& effort,
                    const volatile bool* interrupt);

}  // namespace ambilux::stress
