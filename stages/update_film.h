// update_film: the samples of a wave's pixels are added to the sums of the film, sample after sample: the sums do not
// depend on how samples are dealt to waves.
#pragma once

#include "film/splat_sums.h"
#include "queues/wave.h"
#include "stages/counted.h"

namespace ambilux {

/// Sums of the film, per pixel and channel (FilmMoments).
struct FilmSums {
    double *sum, *sum_squares;
};

struct UpdateFilm {
    static constexpr const char* kName = "update_film";

    Wave wave;
    const Lane* samples;  ///< by slot: what eye subpaths brought
    SplatSums splats;     ///< what light subpaths brought, if there are any; emptied
    FilmSums film;
    StageRecord* record;

    /// `i` is a slot of the wave's first sample.
    AMBILUX_HD void operator()(uint32_t i) const {
        const PathSlot p = wave.locate(i);
        if (!p.active) return;
        const uint64_t at = uint64_t(p.pixel) * 3;
        double s[3], q[3];
        for (int c = 0; c < 3; ++c) s[c] = film.sum[at + c], q[c] = film.sum_squares[at + c];
        const uint32_t stride = wave.tiles * kTilePixels, count = wave.state->samples;
        constexpr uint32_t kTogether = 4;  // loads that do not wait for each other
        for (uint32_t first = 0; first < count; first += kTogether) {
            Rgb eye[kTogether];
            double value[kTogether][3] = {};
            const auto each = [&](auto f) {
                for (uint32_t k = 0; k < kTogether; ++k)
                    if (first + k < count) f(k, uint64_t(first + k) * wave.height * wave.width + p.pixel);
            };
            each([&](uint32_t k, uint64_t cell) {
                eye[k] = start_of<Rgb>(samples[i + (first + k) * stride]);
                if (splats.exists()) splats.read(cell, value[k]);
            });
            each([&](uint32_t k, uint64_t cell) {
                if (splats.exists()) splats.clear(cell);
                for (int c = 0; c < 3; ++c) value[k][c] += double(eye[k][c]);
                if (!is_valid_radiance({float(value[k][0]), float(value[k][1]), float(value[k][2])}, record)) return;
                for (int c = 0; c < 3; ++c) {
                    s[c] += value[k][c];
                    q[c] += value[k][c] * value[k][c];
                }
            });
        }
        for (int c = 0; c < 3; ++c) {
            film.sum[at + c] = s[c];
            film.sum_squares[at + c] = q[c];
        }
    }
};

}  // namespace ambilux
