#include "integrators/bdpt/learned/settings.h"

#include "integrators/bdpt/learned/variant.h"

namespace ambilux {

std::vector<Declaration<LearnedSettings>> LearnedVariant::settings() {
    using Of = Declare<LearnedSettings>;
    return {Of::number("learned_share", &LearnedSettings::share, 0.0f, 0.95f,
                       "draws that follow what was learned; the others draw from all light vertices alike"),
            Of::number("learned_weight", &LearnedSettings::weight, 0.25f, 64.0f,
                       "draws that multiple importance sampling counts for each that is made: learned ones find more")};
}

LearnedSettings LearnedSettings::plan(const RenderSettings& settings) {
    return own_settings(LearnedVariant::settings(), settings);
}

}  // namespace ambilux
