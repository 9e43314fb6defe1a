// What variant correlated of integrator vcm has.
#pragma once

#include "integrators/bdpt/vcm/variant.h"

namespace ambilux {

struct CorrelatedVariant : MergingVariant {
    static constexpr const char* kHelp =
        "vcm whose weights know that merges share eye subpaths (Grittmann et al. 2021), in paths of up to nine "
        "segments; "
        "an ablation, without a replay";
    static constexpr VariantTraits kTraits = [] {
        VariantTraits t = VcmVariant::kTraits;
        t.replay = ReplayPairing::no_replay;
        return t;
    }();

    static std::vector<Declaration<VcmSettings>> settings() { return VcmVariant::settings(); }
    static uint32_t strategies(const RenderSettings& s) { return VcmVariant::strategies(s); }
};

}  // namespace ambilux
