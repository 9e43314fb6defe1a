// What integrator vcm has.
#pragma once

#include "integrators/bdpt/vcm/settings.h"
#include "integrators/offers.h"
#include "integrators/setting.h"

namespace ambilux {

struct VcmVariant {
    static constexpr const char* kHelp =
        "vertex connection and merging (Georgiev et al. 2012), consistent, not unbiased: bdpt that also merges eye "
        "vertices with the light vertices of an iteration that lie within a radius";
    static constexpr VariantTraits kTraits = {
        .strategies = true, .light_subpaths = true, .draws = true, .sorts = false, .compacts = false};

    static std::vector<Declaration<VcmSettings>> settings();
    static std::vector<Stressed> stress() { return {}; }  // tests of means would find its bias
};

}  // namespace ambilux
