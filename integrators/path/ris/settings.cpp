#include "integrators/path/ris/variant.h"

namespace ambilux {

std::vector<Declaration<RisSettings>> PathRisVariant::settings() {
    return {Declare<RisSettings>::number("candidates", &RisSettings::candidates, 1u, RisSettings::kMostCandidates,
                                         "emitter samples that an eye vertex chooses one from")};
}

RisSettings RisSettings::plan(const RenderSettings& settings) {
    return own_settings(PathRisVariant::settings(), settings);
}

}  // namespace ambilux
