#include "stress/methods.h"

#include <sstream>

#include "integrators/registry.h"

namespace ambilux::stress {

const std::vector<Method>& methods() {
    static const std::vector<Method> list = [] {
        std::vector<Method> all;
        for (const Variant& v : variants())
            for (const Stressed& s : v.stress) {
                all.push_back({s.name, {{"integrator", v.integrator}, {"variant", v.variant}}, s.quick, s.bias});
                all.back().settings.insert(all.back().settings.end(), s.settings.begin(), s.settings.end());
            }
        return all;
    }();
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
