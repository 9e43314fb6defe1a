// What paths find becomes what is learned. A record is made of a scattered ray; what its path brings after it is known
// when the wave is done.
#pragma once

#include "integrators/path/guided/directions.h"
#include "integrators/path/guided/state.h"
#include "stages/stage.h"

namespace ambilux {

/// Which slots train. Memory is bounded: one of 2^shift, told by tile and sample, so by no wave.
struct GuideTraining {
    static constexpr uint32_t kDepths = 8;  ///< vertices of a path that are recorded, the first ones

    uint32_t shift;

    AMBILUX_HD bool trains(const Wave& wave, uint32_t slot, uint32_t by) const {
        const uint32_t s = wave.sample_of(slot), tile = wave.state->first_tile + slot / kTilePixels - s * wave.tiles;
        const uint32_t pick =
            hash_word({tile, wave.state->first_sample + s, uint32_t(wave.seed), uint32_t(wave.seed >> 32)});
        return ((slot ^ pick) & ((1u << by) - 1)) == 0;
    }
    AMBILUX_HD bool trains(const Wave& wave, uint32_t slot) const { return trains(wave, slot, shift); }
    /// Of records in a wave of so many slots.
    AMBILUX_HD uint32_t places(uint32_t slots) const { return (slots >> shift) * kDepths; }
    AMBILUX_HD uint32_t place(uint32_t slot) const { return (slot >> shift) * kDepths; }
};

/// A scattered ray.
struct GuideRecord {
    Vec3f p;
    float scale;  ///< what is learned is scale · (what the path brings after it), for target moment its square; 0: none
    Vec2f direction;  ///< in the unit square
    float before;     ///< luminance that the path had brought
    uint32_t pad;
};

/// Camera rays of the slots that train in this round.
template <class Generate>
struct GenerateTraining : Generate {
    GuideTraining training;
    uint32_t share = 0;  ///< one of 2^share slots, at most those that train
    const GuideProgress* progress = nullptr;
    uint32_t round = 0;

    using Ray = typename Generate::Items::Ray;

    AMBILUX_HD void operator()(uint32_t slot) const {
        Ray ray;
        if (make(slot, ray)) this->rays.push(ray);
    }
    AMBILUX_HD bool make(uint32_t slot, Ray& ray) const {
        return progress->rounds == round && training.trains(this->wave, slot, max(share, training.shift)) &&
               Generate::make(slot, ray);
    }
};

/// Over the hits of a depth, before their vertices: what paths had brought is all that came from vertices before.
template <class Mis>
struct RecordRays {
    static constexpr const char* kName = "guide_record";
    using Items = SubpathItems<Mis>;
    using RayItem = typename Items::Ray;

    Wave wave;
    GuideTraining training;
    GuideTarget target;
    Queue<HitItem<RayItem>> hits;
    LaneArray<GuideRecord> records;
    const Lane* samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        const RayItem ray = hits.load(i).ray;
        const uint32_t depth = ray.bits.depth();
        if (depth < 2 || depth - 2 >= GuideTraining::kDepths || ray.bits.delta() || !training.trains(wave, ray.path))
            return;
        const Subpath<Mis> path = Items::unpack(ray);
        const float pdf_sa = path.sums.pdf_sa;
        const float scale = target == GuideTarget::moment ? sqrtf(pdf_sa) / path.sums.before
                                                          : 1.0f / (luminance(path.throughput) * pdf_sa);
        if (!(scale > 0.0f && scale < kInfinity)) return;
        records.store(training.place(ray.path) + depth - 2,
                      {path.origin, scale, square_of_direction(path.direction),
                       luminance(start_of<Rgb>(samples[ray.path])), 0});
    }
};

/// Adds the records of a slot to the sums of the trees.
struct LearnRecords {
    static constexpr const char* kName = "guide_learn";
    /// Of the mean in units, and the most that one value counts: sums of 2^25 such values are no more than integers
    /// hold.
    static constexpr float kMean = 0x1p16f, kMost = 0x1p38f;

    Wave wave;
    GuideTraining training;
    GuideTarget target;
    bool filter;
    GuidedState state;
    LaneArray<GuideRecord> records;
    const Lane* samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        if (!training.trains(wave, slot)) return;
        const float brought = luminance(start_of<Rgb>(samples[slot]));
        for (uint32_t k = 0; k < GuideTraining::kDepths; ++k) {
            const uint32_t place = training.place(slot) + k;
            const GuideRecord r = records.load(place);
            if (r.scale == 0.0f) continue;
            records.store(place, {});
            const float after = r.scale * max(brought - r.before, 0.0f);
            learn(slot, k, r, target == GuideTarget::moment ? after * after : after);
        }
    }

private:
    AMBILUX_HD void learn(uint32_t slot, uint32_t k, const GuideRecord& r, float value) const {
        if (!(value < kInfinity)) return;
        const float unit = state.progress->unit;
        if (unit == 0.0f) {
            if (value > 0.0f) fetch_add_shared(state.exponents + (float_bits(value) >> kFractionBits), 1);
            return;
        }
        const GuideTree& tree = state.tree;
        Vec3f x = tree.unit(r.p);
        GuideTree::Place at = tree.find(x);
        // Blocks of random numbers beyond those of RandomNumbers.
        const RngKey key = wave.key(slot);
        constexpr uint32_t kFirstBlock = 0x20000u;
        if (filter) {
            const Vec4f u = random_floats(key, kFirstBlock + 2 * k);
            const Vec3f side = tree.sides(at.depth);
            x = {moved(x.x, side.x, u.x), moved(x.y, side.y, u.y), moved(x.z, side.z, u.z)};
            at = tree.find(x);
        }
        fetch_add_shared(state.records + at.leaf, 1);
        const float units = min(value / unit, kMost);
        if (!(units >= 1.0f)) return;
        Vec2f d = r.direction;
        GuideQuads::Cell cell = tree.quads.cell(at.leaf, d);
        if (filter) {
            const Vec4f u = random_floats(key, kFirstBlock + 2 * k + 1);
            const float side = GuideQuads::side(cell.level), y = d.y + side * (u.y - 0.5f);
            d = {moved(d.x, side, u.x), clamp(y - floorf(y), 0.0f, kOneMinusEpsilon)};
            cell = tree.quads.cell(at.leaf, d);
        }
        fetch_add_shared(state.sums + (at.leaf * GuideQuads::kNodes + cell.node) * 4ull + cell.quadrant,
                         int64_t(units));
    }
    AMBILUX_HD static float moved(float x, float side, float u) {
        return clamp(x + side * (u - 0.5f), 0.0f, kOneMinusEpsilon);
    }
};

}  // namespace ambilux
