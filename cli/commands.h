// The commands of the program, one function each.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/outputs.h"
#include "formats/load.h"
#include "session/hooks.h"

namespace ambilux {

/// Adds a command to `app`; the function it registers is what main runs, and returns the exit code.
using Run = std::function<int()>;
void add_render(CLI::App& app, Run& run);
void add_info(CLI::App& app, Run& run);
void add_convert(CLI::App& app, Run& run);
void add_reference(CLI::App& app, Run& run);
void add_compare(CLI::App& app, Run& run);
void add_experiment(CLI::App& app, Run& run);
void add_stress(CLI::App& app, Run& run);
void add_bench(CLI::App& app, Run& run);
void add_trace(CLI::App& app, Run& run);
void add_view(CLI::App& app, Run& run);
void add_devices(CLI::App& app, Run& run);
void add_help(CLI::App& app, Run& run);

/// Options that say which scene is meant.
struct SceneOptions {
    std::string path, size;
    bool lenient = false;
    std::vector<std::string> parameters;  ///< NAME=VALUE
    std::vector<std::string> edits;       ///< the same, of parameters by name (formats/edits.h)
    std::string light_picking = "power";
    std::vector<std::string> limits;  ///< KEY=VALUE

    void add_to(CLI::App& command);
    LoadOptions load_options() const;
};

/// Options that say how it is rendered.
struct RenderOptions {
    std::string integrator;  ///< empty: what the scene asks for
    std::string variant = "wavefront", backend = "auto", precision = "single", memory = "all", textures = "device";
    uint64_t seed = 0;
    std::optional<int> max_depth;
    bool deterministic = false;
    std::vector<std::string> set;

    /// `fixed_integrator`: the command decides integrator, variant and estimator itself.
    void add_to(CLI::App& command, bool fixed_integrator);
    /// Settings in the order of rising priority: the scene's hints, options, --set. Throws Error(usage).
    RenderSettings settings(const Scene& scene) const;
};

/// A scene and how long it took to load.
struct LoadedScene {
    Scene scene;
    double seconds = 0;
    LoadTimes times = {};
};
/// Loads and reports the substitutions of --lenient as warnings. Fails before that if `outputs` cannot be written, and
/// after it if one of them is a file of the scene.
LoadedScene load_scene(const SceneOptions& options, const std::vector<Output>& outputs = {});

/// Throws Error(usage) if `path` ends like an image file of another format than `ending`, which is what is written.
void check_image_name(const std::string& option, const std::string& path, const std::string& ending);

/// Writes `json` to a file, or to standard output if `path` is "-".
void write_json(const std::string& path, const nlohmann::json& json);

/// Splits "KEY=VALUE"; throws Error(usage) naming `option`.
std::pair<std::string, std::string> split_assignment(const std::string& text, const std::string& option);

/// Samples and rays per second, for progress lines.
std::string progress_details(uint64_t samples, double seconds, const RenderStats& stats);

}  // namespace ambilux
