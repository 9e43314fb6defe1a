#include "film/moments.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/parallel.h"

namespace ambilux {

double FilmMoments::standard_error(size_t i) const {
    // Of a single sample nothing is known: unknown is not zero.
    if (samples < 2) return std::numeric_limits<double>::infinity();
    return std::sqrt(variance(i) / double(samples));
}

void FilmMoments::add(const FilmMoments& other) {
    if (samples == 0 && sum.empty()) {
        *this = other;
        return;
    }
    if (width != other.width || height != other.height || sum.size() != other.sum.size())
        throw Error(ExitCode::bad_input, "cannot add films of different sizes: " + std::to_string(width) + "x" +
                                             std::to_string(height) + " and " + std::to_string(other.width) + "x" +
                                             std::to_string(other.height));
    samples += other.samples;
    constexpr size_t kTogether = 1 << 15;
    parallel_for((sum.size() + kTogether - 1) / kTogether, [&](size_t part) {
        const size_t end = std::min(sum.size(), (part + 1) * kTogether);
        for (size_t i = part * kTogether; i < end; ++i) {
            sum[i] += other.sum[i];
            sum_squares[i] += other.sum_squares[i];
        }
    });
}

}  // namespace ambilux
