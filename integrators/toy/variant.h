// What integrator toy has.
#pragma once

#include "integrators/setting.h"
#include "integrators/toy/settings.h"

namespace ambilux {

struct ToyVariant {
    static constexpr const char* kHelp = "ambient occlusion: how much of the sky the first surface sees; a tutorial";
    static constexpr VariantTraits kTraits = {.weights = false, .culls = false};

    static std::vector<Declaration<ToySettings>> settings();
};

}  // namespace ambilux
