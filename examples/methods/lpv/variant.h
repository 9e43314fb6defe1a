// What integrator lpv has.
#pragma once

#include "integrators/offers.h"
#include "integrators/setting.h"
#include "settings.h"

namespace ambilux {

struct LpvVariant {
    static constexpr const char* kHelp =
        "cascaded light propagation volumes (Kaplanyan and Dachsbacher 2010), biased: direct light by next event "
        "estimation, and one diffuse bounce that spreads through nested grids of spherical harmonics; a tutorial";
    static constexpr VariantTraits kTraits = {.light_subpaths = true, .weights = false};

    static std::vector<Declaration<lpv::Settings>> settings();
    static std::string bias(const RenderSettings& settings);
    static uint32_t strategies(const RenderSettings&) { return kHitStrategies | kNextEventStrategies; }
    static std::vector<Stressed> stress() { return {}; }  // tests of means would find its bias
};

}  // namespace ambilux
