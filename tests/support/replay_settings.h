// Settings of renders that are replayed.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "accel/shared_accels.h"
#include "render/replay/replay.h"
#include "tests/support/render_scene.h"

namespace ambilux {

/// Settings of a render, by text.
struct ReplayConfig {
    std::string integrator, variant;
    std::vector<std::pair<std::string, std::string>> set;
};

inline RenderSettings settings_of(const Scene& scene, const ReplayConfig& c) {
    RenderSettings s = cpu_settings(scene, Estimator::mis, 7);
    s.integrator = c.integrator;
    s.variant = c.variant;
    for (const auto& [key, value] : c.set) apply_setting(s, key, value);
    return s;
}

inline std::string text_of(const ReplayConfig& c) {
    std::string text = c.integrator + " " + c.variant;
    for (const auto& [key, value] : c.set) text += " " + key + "=" + value;
    return text;
}

}  // namespace ambilux
