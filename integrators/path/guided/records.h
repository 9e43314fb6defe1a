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
    uint32_t tiles;  ///< of the film

    AMBILUX_HD bool trains(const Wave& wave, uint32_t slot, uint32_t by) const {
        const uint32_t pick = hash_word({tile(wave, slot), wave.state->first_sample + wave.sample_of(slot),
                                         uint32_t(wave.seed), uint32_t(wave.seed >> 32)});
        return ((slot ^ pick) & ((1u << by) - 1)) == 0;
    }
    AMBILUX_HD bool trains(const Wave& wave, uint32_t slot) const { return trains(wave, slot, shift); }
    AMBILUX_HD static uint32_t tile(const Wave& wave, uint32_t slot) {
        return wave.state->first_tile + slot / kTilePixels - wave.sample_of(slot) * wave.tiles;
    }
    /// Of records in a wave of so many slots.
    AMBILUX_HD uint32_t places(uint32_t slots) const { return (slots >> shift) * kDepths; }
    AMBILUX_HD uint32_t place(uint32_t slot) const { return (slot >> shift) * kDepths; }
};

/// A scattered ray.
struct GuideRecord {
    Vec3f p;
    float pdf_sa;         ///< of its direction
    uint32_t direction;   ///< in the unit square, twice 16 bits
    float brought;        ///< luminance that the path had brought before
    float before, after;  ///< luminance of its throughput before it was scattered and after

    AMBILUX_HD static uint32_t pack(Vec2f d) { return uint32_t(d.x * 0x1p16f) | uint32_t(d.y * 0x1p16f) << 16; }
    AMBILUX_HD Vec2f place() const {
        return {(float(direction & 0xffffu) + 0.5f) * 0x1p-16f, (float(direction >> 16) + 0.5f) * 0x1p-16f};
    }
};

/// Records of a wave. A slot that trains has those whose bits are set, one for each vertex.
struct GuideRecords {
    LaneArray<GuideRecord> of_vertices;
    uint32_t* made;  ///< by slot that trains
};

/// Camera rays that know what their pixel is expected to be, in slots that have no records yet.
template <class Generate>
struct GenerateGuided : Generate {
    const float* over_pixel = nullptr;  ///< by tile
    GuideTraining training{};
    uint32_t* made = nullptr;  ///< GuideRecords

    using Ray = typename Generate::Items::Ray;

    AMBILUX_HD void operator()(uint32_t slot) const {
        Ray ray;
        if (make(slot, ray)) this->rays.push(ray);
    }
    AMBILUX_HD bool make(uint32_t slot, Ray& ray) const {
        if (!Generate::make(slot, ray)) return false;
        if (training.trains(this->wave, slot)) made[slot >> training.shift] = 0;
        GuidedSums sums = {};
        sums.over_pixel = over_pixel[GuideTraining::tile(this->wave, slot)];
        ray.more = Ray::Sums::pack(sums).more;
        return true;
    }
};

/// Those of the slots that train in this round.
template <class Generate>
struct GenerateTraining : Generate {
    uint32_t share = 0;  ///< one of 2^share slots, at most those that train
    const GuideProgress* progress = nullptr;
    uint32_t round = 0;

    using Ray = typename Generate::Items::Ray;

    AMBILUX_HD void operator()(uint32_t slot) const {
        Ray ray;
        if (make(slot, ray)) this->rays.push(ray);
    }
    AMBILUX_HD bool make(uint32_t slot, Ray& ray) const {
        return progress->rounds == round && this->training.trains(this->wave, slot, max(share, this->training.shift)) &&
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
    Queue<HitItem<RayItem>> hits;
    GuideRecords records;
    const Lane* samples;
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (wave.state->depth < 2 || wave.state->depth - 2 >= GuideTraining::kDepths) return;
        const RayItem ray = hits.load(i).ray;
        const uint32_t depth = ray.bits.depth();
        if (ray.bits.delta() || !training.trains(wave, ray.path)) return;
        const Subpath<Mis> path = Items::unpack(ray);
        const float pdf_sa = path.sums.pdf_sa, before = path.sums.before, after = luminance(path.throughput);
        if (!(pdf_sa > 0.0f && pdf_sa < kInfinity && before > 0.0f && after > 0.0f)) return;
        records.made[ray.path >> training.shift] |= 1u << (depth - 2);
        records.of_vertices.store(training.place(ray.path) + depth - 2,
                                  {path.origin, pdf_sa, GuideRecord::pack(square_of_direction(path.direction)),
                                   luminance(start_of<Rgb>(samples[ray.path])), before, after});
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
    GuidedSettings settings;
    GuidedState state;
    GuideRecords records;
    const Lane* samples;
    StageRecord* record;
    uint32_t share = 0;  ///< as of GenerateTraining
    uint32_t round = kGuideRounds;

    AMBILUX_HD void operator()(uint32_t slot) const {
        if (state.progress->rounds != round || !training.trains(wave, slot, max(share, training.shift))) return;
        if (!wave.locate(slot).active) return;
        const float brought = luminance(start_of<Rgb>(samples[slot]));
        add(state.tiles + 2 * GuideTraining::tile(wave, slot), brought);
        const uint32_t made = records.made[slot >> training.shift];
        for (uint32_t k = 0; made >> k; ++k) {
            if (!(made >> k & 1u)) continue;
            const GuideRecord r = records.of_vertices.load(training.place(slot) + k);
            const float found = max(brought - r.brought, 0.0f), squared = sqr(found / r.before);
            if (!(squared < kInfinity)) continue;
            const Vec3f x = state.tree.unit(r.p);
            const GuideTree::Place at = state.tree.find(x);
            add(state.reflected + 2 * at.leaf, found / r.before);
            learn_share(r, at.leaf, squared);
            learn(slot, k, r, x, at.depth,
                  settings.target == GuideTarget::moment ? squared * r.pdf_sa : found / (r.after * r.pdf_sa));
        }
    }

private:
    /// `value` in units of `sum`; while there is no unit, of its kind, it is what one will be made of, and 0.
    AMBILUX_HD float in_units(GuideSum sum, float value) const {
        const float unit = state.progress->unit[uint32_t(sum)];
        if (unit > 0.0f) return value / unit;
        if (value > 0.0f)
            fetch_add_shared(
                state.exponents + uint32_t(sum) * GuidedState::kExponents + (float_bits(value) >> kFractionBits), 1);
        return 0.0f;
    }
    /// A radiance to a count and a sum.
    AMBILUX_HD void add(int64_t* sum, float radiance) const {
        const float units = in_units(GuideSum::radiance, radiance);
        if (!(units < kInfinity) || state.progress->unit[uint32_t(GuideSum::radiance)] == 0.0f) return;
        fetch_add_shared(sum, 1);
        if (units > 0.0f) fetch_add_shared(sum + 1, int64_t(min(units, kMost)));
    }
    /// What the second moment would have been with other shares of the BSDF (GuideShares).
    AMBILUX_HD void learn_share(const GuideRecord& r, uint32_t leaf, float squared) const {
        const float units = in_units(GuideSum::moment, squared);
        if (!settings.learn_share || !(units > 0.0f)) return;
        const GuideTree& tree = state.tree;
        const float now = tree.leaves[leaf].bsdf_share;
        if (now == 1.0f) return;
        const float guide = kInv4Pi * tree.quads.cell(leaf, r.place()).density,
                    bsdf = max(r.pdf_sa - (1.0f - now) * guide, 0.0f) / now;
        for (uint32_t k = 0; k < GuideShares::kCount; ++k) {
            const float other = GuideShares::of(k), pdf_sa = other * bsdf + (1.0f - other) * guide;
            fetch_add_shared(state.shares + leaf * GuideShares::kCount + k,
                             int64_t(min(units * (r.pdf_sa / pdf_sa), GuideShares::kMost)));
        }
    }
    /// Of a record at `x` in the unit cube, in a leaf of this depth.
    AMBILUX_HD void learn(uint32_t slot, uint32_t k, const GuideRecord& r, Vec3f x, uint32_t depth, float value) const {
        const float units = min(in_units(GuideSum::target, value), kMost);
        if (!(units >= 1.0f)) return;
        const GuideTree& tree = state.tree;
        // Blocks of random numbers beyond those of RandomNumbers.
        const RngKey key = wave.key(slot);
        constexpr uint32_t kFirstBlock = 0x20000u;
        if (settings.filter) {
            const Vec4f u = random_floats(key, kFirstBlock + 2 * k);
            const Vec3f side = tree.sides(depth);
            x = {moved(x.x, side.x, u.x), moved(x.y, side.y, u.y), moved(x.z, side.z, u.z)};
        }
        const uint32_t leaf = tree.find(x).leaf;
        Vec2f d = r.place();
        GuideQuads::Cell cell = tree.quads.cell(leaf, d);
        if (settings.filter) {
            const Vec4f u = random_floats(key, kFirstBlock + 2 * k + 1);
            const float side = GuideQuads::side(cell.level), y = d.y + side * (u.y - 0.5f);
            d = {moved(d.x, side, u.x), clamp(y - floorf(y), 0.0f, kOneMinusEpsilon)};
            cell = tree.quads.cell(leaf, d);
        }
        const uint64_t place = (leaf * GuideQuads::kNodes + cell.node) * 4ull + cell.quadrant;
        fetch_add_shared(state.found + place, 1);
        fetch_add_shared(state.sums + place, int64_t(units));
    }
    AMBILUX_HD static float moved(float x, float side, float u) {
        return clamp(x + side * (u - 0.5f), 0.0f, kOneMinusEpsilon);
    }
};

}  // namespace ambilux
