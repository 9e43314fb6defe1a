// What variant ris of integrator path has.
#pragma once

#include "integrators/path/ris/settings.h"
#include "integrators/path/variant.h"
#include "integrators/setting.h"

namespace ambilux {

struct PathRisVariant {
    static constexpr const char* kHelp =
        "next event estimation by resampling: of several emitter samples one is kept, in proportion to its light "
        "(Talbot et al. 2005)";
    static constexpr VariantTraits kTraits = [] {
        VariantTraits traits = PathVariant::kTraits;
        traits.in_double = false;
        return traits;
    }();

    static std::vector<Declaration<RisSettings>> settings();
    static uint32_t strategies(const RenderSettings& s) { return PathVariant::strategies(s); }
    static std::vector<Stressed> stress() { return {{"path-ris", {}, false}}; }
};

}  // namespace ambilux
