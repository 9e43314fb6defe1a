// Which paths are learned from.
#pragma once

#include "core/rng.h"
#include "integrators/shared/guide/state.h"
#include "queues/wave.h"

namespace ambilux {

/// Which slots train. Memory is bounded: one of 2^shift, told by tile and sample, so by no wave.
struct GuideTraining {
    static constexpr uint32_t kDepths = 8;  ///< vertices of a path that are recorded, the first ones

    uint32_t shift;
    uint32_t tiles;        ///< of the film
    uint32_t until = ~0u;  ///< iterations that are learned from

    AMBILUX_HD bool learns(const GuideProgress& p) const { return p.rounds < kGuideRounds || p.iterations < until; }

    AMBILUX_HD bool trains(const Wave& wave, uint32_t slot, uint32_t by) const {
        return ((slot ^ pick(wave, slot)) & ((1u << by) - 1)) == 0;
    }
    AMBILUX_HD bool trains(const Wave& wave, uint32_t slot) const { return trains(wave, slot, shift); }
    AMBILUX_HD static uint32_t tile(const Wave& wave, uint32_t slot) {
        return wave.state->first_tile + slot / kTilePixels - wave.sample_of(slot) * wave.tiles;
    }
    /// The slot that trains among those of number `group`, 2^shift together.
    AMBILUX_HD uint32_t slot_of(const Wave& wave, uint32_t group) const {
        const uint32_t first = group << shift;
        return first | (pick(wave, first) & ((1u << shift) - 1));
    }
    /// Of records in a wave of so many slots.
    AMBILUX_HD uint32_t places(uint32_t slots) const { return (slots >> shift) * kDepths; }
    AMBILUX_HD uint32_t place(uint32_t slot) const { return (slot >> shift) * kDepths; }

private:
    /// The same for all slots of a tile and sample.
    AMBILUX_HD static uint32_t pick(const Wave& wave, uint32_t slot) {
        return hash_word({tile(wave, slot), wave.state->first_sample + wave.sample_of(slot), uint32_t(wave.seed),
                          uint32_t(wave.seed >> 32)});
    }
};

}  // namespace ambilux
