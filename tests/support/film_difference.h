// How far two films are apart.
#pragma once

#include <cmath>

#include "film/moments.h"

namespace ambilux {

/// Root of the sum of squares of differences over that of `a`.
inline double relative_difference(const FilmMoments& a, const FilmMoments& b) {
    double difference = 0, size = 0;
    for (size_t i = 0; i < a.sum.size(); ++i) {
        difference += (a.sum[i] - b.sum[i]) * (a.sum[i] - b.sum[i]);
        size += a.sum[i] * a.sum[i];
    }
    return std::sqrt(difference / size);
}

}  // namespace ambilux
