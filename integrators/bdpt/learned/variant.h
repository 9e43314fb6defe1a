// What variant learned of integrator bdpt has.
#pragma once

#include <vector>

#include "integrators/bdpt/learned/settings.h"
#include "integrators/setting.h"

namespace ambilux {

struct LearnedVariant {
    static constexpr const char* kHelp =
        "lvc whose draws follow what light vertices have brought to eye vertices in earlier passes";
    static constexpr VariantTraits kTraits = {
        .strategies = true, .light_subpaths = true, .draws = true, .repeats = false, .finds_all_light = true};

    static std::vector<Declaration<LearnedSettings>> settings();
};

}  // namespace ambilux
