// What integrator vpl has.
#pragma once

#include "integrators/bdpt/vpl/settings.h"
#include "integrators/offers.h"
#include "integrators/setting.h"

namespace ambilux {

struct VplVariant {
    static constexpr const char* kHelp =
        "instant radiosity (Keller 1997), biased where the geometry term is bounded (Kollig and Keller 2004): eye "
        "vertices are connected with the light vertices of a few light subpaths that all pixels share";
    static constexpr VariantTraits kTraits = {.weights = false};

    static std::vector<Declaration<VplSettings>> settings();
    static std::string bias(const RenderSettings& settings);
    static uint32_t strategies(const RenderSettings&) {
        return kHitStrategies | kNextEventStrategies | kConnectionStrategies | kJoinedAtFirst;
    }
    /// Clamped its means are too low, else their variance has no bound.
    static std::vector<Stressed> stress() { return {}; }
};

}  // namespace ambilux
