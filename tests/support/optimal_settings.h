// Settings of optimal weights for tests.
#pragma once

#include "integrators/offers.h"
#include "tests/support/whole_iterations.h"

namespace ambilux {

inline RenderSettings optimal(const Scene& scene, uint64_t seed, const SettingTexts& own = {}) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.variant = "optimal";
    for (const auto& [key, value] : own) apply_setting(s, key, value);
    return s;
}

}  // namespace ambilux
