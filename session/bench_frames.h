// How many images a second a renderer gives whose every image is new, as while a camera moves.
#pragma once

#include <vector>

#include "render/renderer.h"

namespace ambilux {

/// Seconds of frames, each: a film that is cleared, one iteration (for most methods: one sample of every pixel), and
/// its image in the memory of the host.
struct FrameTimes {
    std::vector<double> seconds;  ///< in their order
    std::vector<float> rgb;       ///< the last image, as Image::rgb

    /// Half of the frames take no longer, or 95 of 100.
    double median() const { return quantile(0.5); }
    double late() const { return quantile(0.95); }

private:
    double quantile(double share) const;
};

/// `frames` of them, after a few that are not timed. Fewer if *interrupt becomes true.
FrameTimes time_frames(Renderer& renderer, uint32_t frames, const volatile bool* interrupt);

}  // namespace ambilux
