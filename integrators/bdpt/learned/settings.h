// Settings of variant learned.
#pragma once

#include "integrators/settings.h"

namespace ambilux {

struct LearnedSettings {
    float share = 0.7f;   ///< of draws that follow what was learned
    float weight = 4.0f;  ///< draws that multiple importance sampling counts for each that is made

    static LearnedSettings plan(const RenderSettings& settings);
};

}  // namespace ambilux
