#include "stress/methods.h"

#include <sstream>

namespace ambilux::stress {

const std::vector<Method>& methods() {
    static const std::vector<Method> list = {
        {"path-naive", {{"integrator", "path"}, {"estimator", "naive"}}},
        {"path-nee", {{"integrator", "path"}, {"estimator", "nee"}}},
        {"path-mis", {{"integrator", "path"}}},
        {"path-mis-power", {{"integrator", "path"}, {"heuristic", "power"}}},
        {"path-ris", {{"integrator", "path"}, {"variant", "ris"}}, false},
        {"light", {{"integrator", "light"}}},
        {"light-power", {{"integrator", "light"}, {"heuristic", "power"}}, false},
        {"bdpt", {{"integrator", "bdpt"}}},
        {"bdpt-power", {{"integrator", "bdpt"}, {"heuristic", "power"}}},
        {"lvc", {{"integrator", "bdpt"}, {"variant", "lvc"}}},
        {"lvc-power", {{"integrator", "bdpt"}, {"variant", "lvc"}, {"heuristic", "power"}}, false},
        {"streaming", {{"integrator", "bdpt"}, {"variant", "streaming"}}},
        {"streaming-power", {{"integrator", "bdpt"}, {"variant", "streaming"}, {"heuristic", "power"}}, false},
        {"megakernel", {{"integrator", "bdpt"}, {"variant", "megakernel"}}},
        {"megakernel-power", {{"integrator", "bdpt"}, {"variant", "megakernel"}, {"heuristic", "power"}}, false},
    };
    return list;
}

RenderSettings settings_of(const Hooks& hooks, const Method& method, const Cell& cell, const Scene& scene,
                           const std::string& backend, uint64_t seed) {
    RenderSettings s;
    s.max_depth = scene.integrator.max_depth;
    s.rr_depth = scene.integrator.rr_depth;
    s.seed = seed;
    s.backend = backend;
    for (const auto& [key, value] : method.settings) hooks.apply_setting(s, key, value);
    for (const auto& [key, value] : cell.settings) hooks.apply_setting(s, key, value);
    return s;
}

bool has_prefix_of(const std::string& text, const std::string& name) {
    std::istringstream words(text);
    for (std::string word; words >> word;)
        if (name.starts_with(word)) return true;
    return false;
}

}  // namespace ambilux::stress
