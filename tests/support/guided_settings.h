// Settings of path guiding for small images: trees split early.
#pragma once

#include "tests/support/whole_iterations.h"

namespace ambilux {

inline RenderSettings guided(const Scene& scene, uint64_t seed, const SettingTexts& own = {}) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, seed);
    s.variant = "guided";
    apply_setting(s, "guide_split", "64");
    apply_setting(s, "guide_samples", "4");
    for (const auto& [key, value] : own) apply_setting(s, key, value);
    return s;
}

}  // namespace ambilux
