// The set of paths in flight: which pixel and sample each slot stands for, and where its random numbers come from.
#pragma once

#include "core/divisor.h"
#include "core/rng.h"
#include "queues/lane_array.h"

namespace ambilux {

/// Side of the square tiles in which pixels are numbered, so that neighbouring threads hold neighbouring pixels.
constexpr uint32_t kTileSide = 8;
constexpr uint32_t kTilePixels = kTileSide * kTileSide;

/// Which memory was too small for a wave.
enum WaveFailure : uint32_t {
    kNoFailure,
    kQueuesFull,    ///< queues that are kept over the wave
    kAppendedFull,  ///< what all waves of an iteration append to
};

/// Part of a wave that changes from one to the next; lives where the kernels run.
struct WaveState {
    uint32_t first_tile;      ///< of this wave
    uint32_t first_sample;    ///< of this wave
    uint32_t samples;         ///< of each pixel in this wave, at most Wave::samples
    uint32_t depth;           ///< segments of the paths in flight
    uint32_t failed;          ///< WaveFailure: the wave, and on a device all after it, do nothing until there is room
    uint32_t done;            ///< waves of phases that may fail, and did not
    uint32_t light_subpaths;  ///< of this wave
    uint32_t iteration;       ///< number of the first of the iterations that are done with this wave's
    uint32_t appended;        ///< where this wave's part of what all waves append to begins
    alignas(128) uint32_t next =
        0;  ///< slots that threads of a launch have claimed; away from what is read all the time
};

/// Place of slot `z` of a tile, along the Z curve.
AMBILUX_HD uint32_t x_in_tile(uint32_t z) { return (z & 1) | (z >> 1 & 2) | (z >> 2 & 4); }
AMBILUX_HD uint32_t y_in_tile(uint32_t z) { return (z >> 1 & 1) | (z >> 2 & 2) | (z >> 3 & 4); }

/// What a slot stands for.
struct PathSlot {
    uint32_t x, y;   ///< pixel of the crop
    uint32_t pixel;  ///< y * width + x
    uint32_t sample;
    bool active;  ///< false: outside the film, or past the samples of this wave
};

/// Slots are numbered sample by sample; within one sample tile by tile, within a tile along the Z curve. A film whose
/// size is no multiple of the tile leaves slots empty.
struct Wave {
    const WaveState* state;
    uint64_t seed;
    uint32_t width, height;  ///< pixels of the crop
    Divisor tiles_x;         ///< tiles in a row of the film
    Divisor tiles;           ///< tiles per wave
    uint32_t samples;        ///< most samples of a pixel per wave
    uint32_t first_key = 0;  ///< of the pixels' random numbers: light subpaths beyond the first of a slot have keys
                             ///< beyond those of all pixels

    AMBILUX_HD uint32_t slot_count() const { return tiles * kTilePixels * samples; }

    /// Of the samples of this wave.
    AMBILUX_HD uint32_t sample_of(uint32_t slot) const { return tiles.quotient(slot / kTilePixels); }

    AMBILUX_HD PathSlot locate(uint32_t slot) const {
        const uint32_t s = sample_of(slot), z = slot % kTilePixels;
        const uint32_t tile = state->first_tile + slot / kTilePixels - s * tiles;
        const uint32_t tile_y = tiles_x.quotient(tile), tile_x = tile - tile_y * tiles_x;
        PathSlot p;
        p.x = tile_x * kTileSide + x_in_tile(z);
        p.y = tile_y * kTileSide + y_in_tile(z);
        p.pixel = p.y * width + p.x;
        p.sample = state->first_sample + s;
        p.active = p.x < width && p.y < height && s < state->samples;
        return p;
    }

    /// Active slots before a slot, or all if there is none of this number.
    AMBILUX_HD uint32_t active_before(uint32_t slot) const {
        const uint32_t s = sample_of(slot), tile = slot / kTilePixels - s * tiles,
                       first = pixels_before(state->first_tile);
        uint32_t before =
            s * (pixels_before(state->first_tile + tiles) - first) + pixels_before(state->first_tile + tile) - first;
        const uint32_t tile_y = tiles_x.quotient(state->first_tile + tile),
                       tile_x = state->first_tile + tile - tile_y * tiles_x;
        if ((tile_x + 1) * kTileSide <= width && (tile_y + 1) * kTileSide <= height) return before + slot % kTilePixels;
        for (uint32_t k = slot / kTilePixels * kTilePixels; k < slot; ++k) before += locate(k).active;
        return before;
    }
    /// Pixels of the tiles before a tile of the film.
    AMBILUX_HD uint32_t pixels_before(uint32_t tile) const {
        const uint32_t y = tiles_x.quotient(tile), x = tile - y * tiles_x, above = y * kTileSide;
        if (above >= height) return width * height;
        return above * width + x * kTileSide * (height - above < kTileSide ? height - above : kTileSide);
    }

    AMBILUX_HD RngKey key(const PathSlot& p, Stream stream = Stream::eye) const {
        return {seed, first_key + p.pixel, p.sample, stream};
    }
    AMBILUX_HD RngKey key(uint32_t slot, Stream stream = Stream::eye) const { return key(locate(slot), stream); }
};

/// Most light subpaths of one slot: each takes a launch of all stages of light subpaths.
constexpr uint32_t kMostLightRounds = 16;

/// Light subpaths that begin in a slot if there are `per_tile` of them in the slots of a tile: as evenly as can be, and
/// some in the first slot, which any tile of the film has.
AMBILUX_HD uint32_t light_subpaths_of(uint32_t slot, uint32_t per_tile) {
    const uint32_t z = slot % kTilePixels, up = kTilePixels - 1;
    return ((z + 1) * per_tile + up) / kTilePixels - (z * per_tile + up) / kTilePixels;
}

/// Number, in the render, of the light subpath that begins in a slot and a round (Wave::first_key): sample by sample,
/// in the order of slots. Tiles that lie partly off the film leave gaps.
AMBILUX_HD uint64_t light_subpath_number(const Wave& wave, uint32_t slot, uint32_t per_tile) {
    const uint32_t s = wave.sample_of(slot), z = slot % kTilePixels;
    const uint32_t tile = wave.state->first_tile + slot / kTilePixels - s * wave.tiles;
    const uint32_t film_tiles = wave.tiles_x * ((wave.height + kTileSide - 1) / kTileSide);
    const uint32_t before = (z * per_tile + kTilePixels - 1) / kTilePixels;
    const uint32_t round = wave.first_key / (wave.width * wave.height);
    return (uint64_t(wave.state->first_sample + s) * film_tiles + tile) * per_tile + before + round;
}

/// Light subpaths of one sample that begin in the `tiles` tiles from `first_tile` on.
inline uint32_t light_subpaths_in(const Wave& wave, uint32_t first_tile, uint32_t tiles, uint32_t per_tile) {
    uint32_t count = 0;
    for (uint32_t tile = first_tile; tile < first_tile + tiles; ++tile) {
        const uint32_t x = tile % wave.tiles_x * kTileSide, y = tile / wave.tiles_x * kTileSide;
        const bool whole = x + kTileSide <= wave.width && y + kTileSide <= wave.height;
        for (uint32_t z = 0; !whole && z < kTilePixels; ++z)
            if (x + x_in_tile(z) < wave.width && y + y_in_tile(z) < wave.height)
                count += light_subpaths_of(z, per_tile);
        if (whole) count += per_tile;
    }
    return count;
}

}  // namespace ambilux
