#include "experiments/reference_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <thread>
#include <vector>

#include "core/error.h"
#include "core/flag.h"
#include "core/log.h"
#include "core/sha256.h"
#include "session/statistics.h"

namespace ambilux {

namespace fs = std::filesystem;

RenderSettings reference_settings(const ExperimentConfig& config, const SceneEntry& entry, const Scene& scene,
                                  int max_depth, const Hooks& hooks) {
    RenderSettings s;
    s.backend = config.backend;
    s.max_depth = max_depth;
    s.rr_depth = scene.integrator.rr_depth;
    const RunEntry& how = entry.reference.how;
    for (size_t i = 0; i < how.settings.size(); ++i) try {
            hooks.apply_setting(s, how.settings[i].first, how.settings[i].second);
        } catch (const Error& e) {
            throw input_error(config.file, how.lines[i], fmt::format("reference of '{}': {}", entry.name, e.what()));
        }
    s.seed = config.reference_seed;
    return s;
}

ReferencePlace find_reference(const std::string& folder, const ExperimentConfig& config, const SceneEntry& entry,
                              const Scene& scene, int max_depth, const Hooks& hooks) {
    ReferencePlace place;
    place.settings = reference_settings(config, entry, scene, max_depth, hooks);
    const Settings& set = entry.reference.how.settings;
    std::string making;
    for (const auto& [key, value] : set)
        place.settings_text += (place.settings_text.empty() ? "" : " ") + key + "=" + value;
    if (place.settings_text == "integrator=" + RenderSettings().integrator) place.settings_text.clear();
    if (!place.settings_text.empty()) {
        making = "-" + place.settings.integrator + "-" + to_hex(sha256(place.settings_text)).substr(0, 8);
    }
    const std::string depth = max_depth < 0 ? "inf" : std::to_string(max_depth);
    const std::string seed = config.reference_seed ? fmt::format("-s{}", config.reference_seed) : "";
    const std::string key = fmt::format("-{}-d{}-{}x{}{}{}.exr", scene_hash(scene).substr(0, 12), depth,
                                        scene.sensor.crop_width, scene.sensor.crop_height, making, seed);
    place.path = folder + "/" + entry.base + key;
    if (!fs::exists(place.path)) {
        std::vector<std::string> others;
        std::error_code missing;
        for (const auto& file : fs::directory_iterator(folder, missing))
            if (file.path().filename().string().ends_with(key)) others.push_back(file.path().filename().string());
        if (!others.empty()) place.path = folder + "/" + *std::min_element(others.begin(), others.end());
    }
    if (fs::exists(place.path)) {
        // A file that cannot be read is named when the reference is made.
        try {
            place.cached = read_reference_exr(place.path).samples;
        } catch (const Error&) {}
    }
    return place;
}

/// The file beside a reference that is locked, the same by whatever links it is named.
static std::string lock_file(const std::string& path) {
    const fs::path file = fs::weakly_canonical(path);
    return (file.parent_path() / fmt::format(".{}.lock", file.filename().string())).string();
}

ReferenceLock::ReferenceLock(const std::string& path, const volatile bool* interrupt) : lock_(lock_file(path)) {
    for (bool said = false; !lock_.try_lock(); said = true) {
        if (is_set(interrupt)) return;
        if (!said) log_info(fmt::format("{} is being made by another process: waiting for it", path));
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
    held_ = true;
}

nlohmann::json describe_reference(const ReferencePlace& place, const Reference& image, const Attributes& attributes,
                                  const std::string& folder, uint64_t seed) {
    namespace fs = std::filesystem;
    double noise = 0;
    for (const float se : image.standard_error.rgb) noise += double(se) * double(se);
    const fs::path absolute = fs::absolute(place.path).lexically_normal();
    const fs::path inside = absolute.lexically_relative(fs::absolute(folder).lexically_normal());
    const bool is_inside = !inside.empty() && *inside.begin() != "..";
    return {{"file", (is_inside ? inside : absolute).string()},
            {"spp", image.samples},
            {"seed", seed},
            {"integrator", place.settings.integrator},
            {"settings", place.settings_text},
            {"noise", std::sqrt(noise / double(image.standard_error.rgb.size()))},
            {"seconds", attributes.value("seconds", 0.0)},
            {"backend", attributes.value("backend", "")},
            {"git_revision", attributes.value("git_revision", "")}};
}

}  // namespace ambilux
