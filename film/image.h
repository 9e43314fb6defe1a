// Images in memory.
#pragma once

#include <cstdint>
#include <vector>

#include "film/moments.h"

namespace ambilux {

/// Linear Rec.709 radiance, row-major from the top left: value (y*width + x)*3 + channel.
struct Image {
    uint32_t width = 0, height = 0;
    std::vector<float> rgb;
};

/// An image of means together with their standard errors, as the reference files hold it.
struct Reference {
    Image mean;
    Image standard_error;  ///< of each mean; empty (0x0) if the file states none
    uint64_t samples = 0;  ///< per pixel; 0 if the file states none
};

/// Mean of every pixel, rounded to float.
Image mean_image(const FilmMoments& moments);

/// Means and standard errors, rounded to float.
Reference to_reference(const FilmMoments& moments);

/// The sums that a reference came from, so that more samples can be added: sum = mean·n, sum of squares = se²·n(n-1) +
/// n·mean². Exact up to the rounding of the stored floats (6e-8 relative). Throws Error(bad_input) without standard
/// errors or with fewer than two samples.
FilmMoments to_moments(const Reference& reference);

}  // namespace ambilux
