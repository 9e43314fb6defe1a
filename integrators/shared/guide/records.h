// What paths find becomes what is learned. A record is made of a scattered ray; what its path brings after it is known
// when the wave is done.
#pragma once

#include "integrators/shared/guide/directions.h"
#include "integrators/shared/guide/training.h"
#include "stages/stage.h"

namespace ambilux {

/// A scattered ray.
struct GuideRecord {
    uint32_t leaf;       ///< where it was scattered
    uint32_t direction;  ///< in the unit square, twice 16 bits
    float pdf_sa;        ///< of it
    float brought;       ///< luminance that the path had brought before
    float before;        ///< luminance of its throughput before it was scattered
    float whole;         ///< and after it, without roulette
    float survival;      ///< of roulette
    uint32_t pad;

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
    using Sums = decltype(Generate::Items::Path::sums);

    AMBILUX_HD void operator()(uint32_t slot) const {
        Ray ray;
        if (make(slot, ray)) this->rays.push(ray);
    }
    AMBILUX_HD bool make(uint32_t slot, Ray& ray) const {
        if (!Generate::make(slot, ray)) return false;
        if (training.trains(this->wave, slot)) made[slot >> training.shift] = 0;
        const float expected = over_pixel[GuideTraining::tile(this->wave, slot)];
        Sums sums = {};
        sums.over_pixel = expected;
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
    const GuideProgress* progress;

    AMBILUX_HD void operator()(uint32_t i) const {
        if (wave.state->depth < 2 || wave.state->depth - 2 >= GuideTraining::kDepths) return;
        if (!training.learns(*progress)) return;
        const RayItem start = hits.items.load(i, 2).ray;  // of most no more is needed
        const uint32_t depth = start.bits.depth();
        if (start.bits.delta() || !training.trains(wave, start.path)) return;
        const RayItem ray = hits.load(i).ray;
        const Subpath<Mis> path = Items::unpack(ray);
        const auto sums = path.sums;
        const float pdf_sa = pdf_of_ray(sums), after = luminance(path.throughput);
        if (!(pdf_sa > 0.0f && pdf_sa < kInfinity && sums.before > 0.0f && sums.whole > 0.0f && after > 0.0f)) return;
        records.made[ray.path >> training.shift] |= 1u << (depth - 2);
        records.of_vertices.store(
            training.place(ray.path) + depth - 2,
            {sums.leaf, GuideRecord::pack(square_of_direction(path.direction)), pdf_sa,
             luminance(start_of<Rgb>(samples[ray.path])), sums.before, sums.whole, min(sums.whole / after, 1.0f), 0});
    }
};

/// Adds to the sums of a tree.
struct GuideAdds {
    /// Of the mean in units, and the most that one value counts: sums of 2^25 such values are no more than integers
    /// hold.
    static constexpr float kMean = 0x1p16f, kMost = 0x1p38f;

    Wave wave;
    GuideTraining training;
    GuidedSettings settings;
    GuidedState state;
    StageRecord* record;

protected:
    /// `value` in units of `sum`; while there is no unit, of its kind, it is what one will be made of, and 0.
    AMBILUX_HD float in_units(GuideSum sum, float value) const {
        const float unit = state.progress->unit[uint32_t(sum)];
        if (unit > 0.0f) return value / unit;
        if (value > 0.0f)
            fetch_add_shared(
                state.exponents + uint32_t(sum) * GuidedState::kExponents + (float_bits(value) >> kFractionBits), 1);
        return 0.0f;
    }
    /// `value` to the cell at `place`, or to one that it is spread to. `number`: among what the path of `slot` adds.
    AMBILUX_HD void add_to_cell(uint32_t slot, uint32_t number, uint32_t leaf, Vec2f place, GuideQuads::Cell cell,
                                float value) const {
        const float units = min(in_units(GuideSum::target, value), kMost);
        if (!(units >= 1.0f)) return;
        if (settings.filter) {
            // Blocks of random numbers beyond those of RandomNumbers.
            constexpr uint32_t kFirstBlock = 0x20000u;
            const Vec4f u = random_floats(wave.key(slot), kFirstBlock + number);
            const float side = GuideQuads::side(cell.level), y = place.y + side * (u.y - 0.5f);
            cell = state.tree.quads.cell(leaf, {clamp(place.x + side * (u.x - 0.5f), 0.0f, kOneMinusEpsilon),
                                                clamp(y - floorf(y), 0.0f, kOneMinusEpsilon)});
        }
        const uint64_t sum = (leaf * GuideQuads::kNodes + cell.node) * 4ull + cell.quadrant;
        fetch_add_shared(state.found + sum, 1);
        fetch_add_shared(state.sums + sum, int64_t(units));
    }
};

/// Adds the records of the slot that trains in a group to the sums of the tree of eye subpaths.
struct LearnRecords : GuideAdds {
    static constexpr const char* kName = "guide_learn";
    static constexpr float kWeight = 0x1p8f;  ///< units of a weight

    GuideRecords records;
    const Lane* samples;
    uint32_t share = 0;  ///< as of GenerateTraining
    uint32_t round = kGuideRounds;

    AMBILUX_HD void operator()(uint32_t group) const {
        if (state.progress->rounds != round || !training.learns(*state.progress)) return;
        const uint32_t slot = training.slot_of(wave, group);
        if (!training.trains(wave, slot, max(share, training.shift)) || !wave.locate(slot).active) return;
        const float brought = luminance(start_of<Rgb>(samples[slot]));
        add(state.tiles + 2 * GuideTraining::tile(wave, slot), brought, 1.0f);
        const uint32_t made = records.made[slot >> training.shift];
        for (uint32_t k = 0; made >> k; ++k) {
            if (!(made >> k & 1u)) continue;
            const GuideRecord r = records.of_vertices.load(training.place(slot) + k);
            const float found = max(brought - r.brought, 0.0f), q = r.survival, b = found / r.before;
            const float squared = sqr(b) * q;
            if (!(squared < kInfinity)) continue;
            add(state.reflected + 2 * r.leaf, b, 1.0f / q);
            if (found == 0.0f) continue;
            const GuideQuads::Cell cell = state.tree.quads.cell(r.leaf, r.place());
            learn_share(r, squared, cell.density);
            add_to_cell(slot, k, r.leaf, r.place(), cell,
                        settings.target == GuideTarget::moment ? squared * r.pdf_sa : found / (r.whole * r.pdf_sa));
        }
    }

private:
    /// A radiance to a sum of `weight` and of the radiances.
    AMBILUX_HD void add(int64_t* sum, float radiance, float weight) const {
        const float units = in_units(GuideSum::radiance, radiance);
        if (!(units < kInfinity) || state.progress->unit[uint32_t(GuideSum::radiance)] == 0.0f) return;
        fetch_add_shared(sum, int64_t(weight * kWeight + 0.5f));
        if (units > 0.0f) fetch_add_shared(sum + 1, int64_t(min(units, kMost)));
    }
    /// What the second moment would have been with other shares of the BSDF (GuideShares).
    AMBILUX_HD void learn_share(const GuideRecord& r, float squared, float density) const {
        const float units = in_units(GuideSum::moment, squared);
        if (!settings.learn_share || !(units > 0.0f)) return;
        const float now = state.tree.leaves[r.leaf].bsdf_share;
        if (now == 1.0f) return;
        const float guide = kInv4Pi * density, bsdf = max(r.pdf_sa - (1.0f - now) * guide, 0.0f) / now;
        for (uint32_t k = 0; k < GuideShares::kCount; ++k) {
            const float other = GuideShares::of(k), pdf_sa = other * bsdf + (1.0f - other) * guide;
            fetch_add_shared(state.shares + r.leaf * GuideShares::kCount + k,
                             int64_t(min(units * (r.pdf_sa / pdf_sa), GuideShares::kMost)));
        }
    }
};

/// Over the hits of a depth: the importance that eye subpaths bring there is learned in the tree of light subpaths, in
/// the direction that it came from (Vorba et al. 2014, "On-line Learning of Parametric Mixture Models for Light
/// Transport Simulation"). It counts by what its pixel is expected to be, so that dark ones count as bright ones do.
template <Features F, class Mis>
struct LearnImportance : GuideAdds {
    static constexpr const char* kName = "guide_importance";
    using Items = SubpathItems<Mis>;
    using RayItem = typename Items::Ray;

    SceneView scene;
    Queue<HitItem<RayItem>> hits;
    const GuideProgress* eye;

    AMBILUX_HD void operator()(uint32_t i) const {
        const uint32_t depth = wave.state->depth;
        // Where the camera sees something no direction leads to the camera.
        if (depth < 2 || depth - 2 >= GuideTraining::kDepths || !training.learns(*state.progress)) return;
        const HitItem<RayItem> hit = hits.load(i);
        if (hit.prim == kNone || !training.trains(wave, hit.ray.path)) return;
        const Subpath<Mis> path = Items::unpack(hit.ray);
        // Over the mean of all pixels, so that values are alike before it is known.
        const float of_mean = path.sums.over_pixel * kMean * eye->unit[uint32_t(GuideSum::radiance)],
                    value = recorded_luminance(path.throughput) * (of_mean > 0.0f ? of_mean : 1.0f);
        if (!(value < kInfinity)) return;
        const SurfacePoint point = surface_at<F>(scene, hit.prim, hit.u, hit.v);
        const uint32_t leaf = state.tree.leaf(point.p);
        const Vec2f place = square_of_direction(-path.direction);
        const GuideQuads::Cell cell = state.tree.quads.cell(leaf, place);
        if (training.trains(wave, hit.ray.path, training.shift + kLearnShare))
            learn_share(leaf, fabsf(dot(point.ng, path.direction)), cell.density, value);
        add_to_cell(hit.ray.path, GuideTraining::kDepths + depth - 2, leaf, place, cell, value);
    }

private:
    static constexpr uint32_t kLearnShare = 2;  ///< one of 2^this slots that train

    /// How unlikely the direction was by other shares of the BSDF (GuideShares): the mean is least for what is most
    /// like the importance that arrives. What a light subpath would bring is not known here, nor from where; the BSDF
    /// counts as a diffuse one.
    AMBILUX_HD void learn_share(uint32_t leaf, float cosine, float density, float value) const {
        constexpr float kMostBits = 2.0f * GuideQuads::kLevels, kLeast = 0x1p-16f;
        if (!settings.learn_share || state.tree.leaves[leaf].bsdf_share == 1.0f) return;
        const float units = min(in_units(GuideSum::target, value), GuideShares::kMost);
        for (uint32_t k = 0; k < GuideShares::kCount; ++k) {
            const float share = GuideShares::of(k), here = share * 4.0f * cosine + (1.0f - share) * density;
            fetch_add_shared(state.shares + leaf * GuideShares::kCount + k,
                             int64_t(units * (kMostBits - log2f(max(here, kLeast)))));
        }
    }
};

}  // namespace ambilux
