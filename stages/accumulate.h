// accumulate: contributions to samples, and samples to the film.
#pragma once

#include "items/path_items.h"
#include "queues/wave.h"
#include "stages/stage.h"

namespace ambilux {

/// Adds light to a sample that other threads may add to.
AMBILUX_HD void add_shared(Lane& sample, Rgb value) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    atomicAdd(reinterpret_cast<float4*>(&sample), make_float4(value.x, value.y, value.z, 0.0f));
#elif defined(__CUDA_ARCH__)
    for (int k = 0; k < 3; ++k) atomicAdd(reinterpret_cast<float*>(&sample) + k, value[k]);
#else
    set_start(sample, start_of<Rgb>(sample) + value);  // a host's samples belong to one thread
#endif
}

/// Adds contributions to the samples of their paths. As a rule one launch holds at most one contribution per path, so
/// no two threads meet and the sum does not depend on the order of the queue; launches with several say so by `shared`.
struct Accumulate {
    Queue<Contribution> contributions;
    Lane* samples;
    StageRecord* record;
    Wave wave = {};
    TechniqueFilm techniques = {};
    bool shared = false;

    AMBILUX_HD void operator()(uint32_t i) const { take(contributions.load(i)); }

    AMBILUX_HD uint32_t take(const Contribution& c) const {
        if (!is_light(c.value, record)) return 0;
        if (shared)
            add_shared(samples[c.path], c.value);
        else
            set_start(samples[c.path], start_of<Rgb>(samples[c.path]) + c.value);
        techniques.arrive(wave, c.path, c.value);
        return 0;
    }
};

/// Adds the samples of the wave's pixels to the sums of the film, sample after sample: the sums do not depend on how
/// samples are dealt to waves.
struct Develop {
    Wave wave;
    const Lane* samples;
    double* sum;  ///< per pixel and channel (FilmMoments)
    double* sum_squares;
    StageRecord* record;

    /// `i` is a slot of the wave's first sample.
    AMBILUX_HD void operator()(uint32_t i) const {
        const PathSlot p = wave.locate(i);
        if (!p.active) return;
        const uint64_t at = uint64_t(p.pixel) * 3;
        double s[3] = {sum[at], sum[at + 1], sum[at + 2]},
               q[3] = {sum_squares[at], sum_squares[at + 1], sum_squares[at + 2]};
        const uint32_t stride = wave.tiles * kTilePixels;
        for (uint32_t k = 0; k < wave.state->samples; ++k) {
            Rgb value = start_of<Rgb>(samples[i + k * stride]);
            if (!is_light(value, record)) value = {0.0f, 0.0f, 0.0f};
            for (int c = 0; c < 3; ++c) {
                s[c] += double(value[c]);
                q[c] += double(value[c]) * double(value[c]);
            }
        }
        for (int c = 0; c < 3; ++c) {
            sum[at + c] = s[c];
            sum_squares[at + c] = q[c];
        }
    }
};

}  // namespace ambilux
