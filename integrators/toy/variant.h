// What integrator toy has.
#pragma once

#include "integrators/offers.h"
#include "integrators/setting.h"
#include "integrators/toy/settings.h"

namespace ambilux {

struct ToyVariant {
    static constexpr const char* kHelp = "ambient occlusion: how much of the sky the first surface sees; a tutorial";
    static constexpr VariantTraits kTraits = {.weights = false, .culls = false};

    static std::vector<Declaration<ToySettings>> settings();
    static std::vector<Stressed> stress() { return {}; }  // it estimates no light
};

}  // namespace ambilux
