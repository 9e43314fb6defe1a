// The film of a renderer that gives images of whole passes.
#pragma once

#include "film/image.h"
#include "render/renderer.h"

namespace ambilux {

/// Gathers passes of a peer, and what they cost by the peer's own clock.
class PassFilm {
public:
    PassFilm(uint32_t width, uint32_t height) {
        moments_.width = width;
        moments_.height = height;
        clear();
    }
    /// `image`: mean of `count` samples per pixel. Values that are not finite or negative count as 0 and are counted.
    void add(const Image& image, uint32_t count, double seconds);
    /// The same of values that may be negative, since only sums of passes are radiance.
    void add_signed(const Image& image, uint32_t count, double seconds);
    void clear();
    const FilmMoments& moments() const { return moments_; }
    double last_seconds() const { return last_seconds_; }
    /// Samples for about 0.2 s, from the last pass: powers of two, so that kernels made for a number of samples are
    /// few.
    uint32_t preferred_batch() const;
    /// A stage named after what was asked for, samples and invalid values.
    void state(RenderStats& stats) const;

private:
    FilmMoments moments_;
    InvalidCounts invalid_;
    uint64_t passes_ = 0;
    double last_seconds_ = 0, per_sample_ = 0, seconds_ = 0;
};

/// A 32-bit seed of the pass that begins at sample `first`.
uint32_t pass_seed(uint64_t seed, uint64_t first);

}  // namespace ambilux
