// What integrator photon_density has.
#pragma once

#include "integrators/offers.h"
#include "integrators/setting.h"
#include "settings.h"

namespace ambilux {

struct PhotonDensityVariant {
    static constexpr const char* kHelp =
        "progressive photon mapping (Knaus and Zwicker 2011), consistent, not unbiased: the density of light vertices "
        "around the first vertex of an eye subpath; a tutorial";
    static constexpr VariantTraits kTraits = {.light_subpaths = true, .weights = false, .culls = false};

    static std::vector<Declaration<photon_density::Settings>> settings();
    static std::vector<Stressed> stress() { return {}; }  // tests of means would find its bias
};

}  // namespace ambilux
