// Integrators that merge: vcm, and what is the same with strategies switched off.
#pragma once

#include "integrators/bdpt/vcm/settings.h"
#include "integrators/offers.h"
#include "integrators/setting.h"

namespace ambilux {

/// What they share.
struct MergingVariant {
    static std::vector<Declaration<VcmSettings>> settings();
    static std::string bias(const RenderSettings& settings);
    static std::vector<Stressed> stress() { return {}; }  // vcm stands for them

protected:
    static constexpr VariantTraits traits(Merges merges, bool shadow_rays = false) {
        return {.strategies = merges == Merges::beside,
                .light_subpaths = true,
                .draws = merges == Merges::beside,
                .strategy_images = true,
                .weights = merges != Merges::first,
                .culls = shadow_rays,
                .sorts = false,
                .compacts = false,
                .merges = merges,
                .replay = ReplayPairing::iteration};
    }
};

struct VcmVariant : MergingVariant {
    static constexpr const char* kHelp =
        "vertex connection and merging (Georgiev et al. 2012), consistent, not unbiased: bdpt that also merges eye "
        "vertices with the light vertices of an iteration that lie within a radius";
    static constexpr VariantTraits kTraits = traits(Merges::beside, true);

    static std::vector<Declaration<VcmSettings>> settings();
    /// With the radius that papers use. Corners and edges are what it does not fit to.
    static std::vector<Stressed> stress() { return {{"vcm", {}, false, 0.01}}; }
    static uint32_t strategies(const RenderSettings& s) { return s.strategies | kMergeStrategies; }
    /// Once, with the default of light subpaths.
    static std::vector<SelectionOffer> selection(const SelectionRequest& r) {
        if (r.settings.allow != Allow::consistent || r.light_paths != 1.0f) return {};
        SelectionOffer offer;
        offer.settings = {{"strategies", "all"}};
        offer.connect = offer.measured = true;
        return {offer};
    }
};

struct BpmVariant : MergingVariant {
    static constexpr const char* kHelp =
        "bidirectional photon mapping (Vorba 2011), consistent, not unbiased: merges at all vertices of eye subpaths, "
        "weighted, and emission that is seen through deltas";
    static constexpr VariantTraits kTraits = traits(Merges::alone);

    static uint32_t strategies(const RenderSettings&) { return kHitStrategies | kMergeStrategies; }
};

struct PpmVariant : MergingVariant {
    static constexpr const char* kHelp =
        "progressive photon mapping (Hachisuka et al. 2008, with the radius of Knaus and Zwicker 2011 and new eye "
        "subpaths in every iteration), consistent, not unbiased: merges where eye subpaths first scatter other than "
        "by a delta";
    static constexpr VariantTraits kTraits = traits(Merges::first);

    static uint32_t strategies(const RenderSettings&) { return kHitStrategies | kMergeStrategies; }
};

struct SppmVariant : MergingVariant {
    static constexpr const char* kHelp =
        "stochastic progressive photon mapping (Hachisuka and Jensen 2009, with the radius of Knaus and Zwicker 2011), "
        "consistent, not unbiased: as ppm, but light from emitters comes by next event estimation, that of beams "
        "excepted";
    static constexpr VariantTraits kTraits = traits(Merges::first, true);

    static uint32_t strategies(const RenderSettings&) {
        return kHitStrategies | kNextEventStrategies | kMergeStrategies;
    }
};

struct PmVariant : MergingVariant {
    static constexpr const char* kHelp =
        "photon mapping (Jensen 1996) without a final gathering step, biased: as ppm, with a radius that stays";
    static constexpr VariantTraits kTraits = traits(Merges::first);

    static std::vector<Declaration<VcmSettings>> settings();
    static uint32_t strategies(const RenderSettings&) { return kHitStrategies | kMergeStrategies; }
};

}  // namespace ambilux
