#include <fmt/format.h>

#include <cctype>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <iostream>

#include "cli/commands.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "core/log.h"
#include "core/progress.h"
#include "formats/load.h"
#include "integrators/registry.h"
#include "session/render_plan.h"

namespace ambilux {

std::pair<std::string, std::string> split_assignment(const std::string& text, const std::string& option) {
    const size_t at = text.find('=');
    if (at == 0 || at == std::string::npos)
        throw Error(ExitCode::usage, fmt::format("{} {}: write it as {} NAME=VALUE", option, text, option));
    return {text.substr(0, at), text.substr(at + 1)};
}

/// What a setting is, and its values.
static std::string help_of(const std::string& key) {
    const Setting& s = *find_general_setting(key);
    return fmt::format("{}: {}", s.what.help, s.what.allowed);
}

void SceneOptions::add_to(CLI::App& command) {
    command.add_option("SCENE", path, "Scene: Mitsuba XML, pbrt-v4 (.pbrt, .pbrt.gz) or glTF 2.0 (.gltf, .glb)")
        ->required();
    command.add_option("--size", size, "Film size instead of the scene's")->type_name("WxH");
    command.add_flag("--lenient", lenient,
                     "Replace unknown elements and list each substitution, instead of refusing the scene");
    command.add_option("-D,--define", parameters, "Value of a $parameter of the scene")
        ->allow_extra_args(false)
        ->type_name("NAME=VALUE");
    command
        .add_option("--param", edits,
                    "Set a parameter of the loaded scene, by the name of its object: lamp.radiance=2 "
                    "(docs/scenes.md)")
        ->allow_extra_args(false)
        ->type_name("NAME=VALUE");
    command
        .add_option("--light-picking", light_picking,
                    "How light sampling chooses an emitter: power, uniform or tree (setting light_picking)")
        ->capture_default_str();
    command
        .add_option("--limits", limits,
                    "Limits on what the scene may request; defaults are " + limits_text({}) + " (docs/limits.md)")
        ->allow_extra_args(false)
        ->type_name("KEY=N");
}

LoadOptions SceneOptions::load_options() const {
    LoadOptions options;
    for (const std::string& limit : limits) set_limit(options.limits, limit);
    options.lenient = lenient;
    if (light_picking == "uniform")
        options.light_picking = LightPicking::uniform;
    else if (light_picking == "tree")
        options.light_picking = LightPicking::tree;
    else if (light_picking != "power")
        throw Error(ExitCode::usage,
                    fmt::format("--light-picking {}: power, uniform and tree are known", light_picking));
    if (!size.empty()) {
        const char* end = size.data() + size.size();
        const auto width = std::from_chars(size.data(), end, options.width);
        const bool separated = width.ec == std::errc() && width.ptr != end && *width.ptr == 'x';
        const auto height = separated ? std::from_chars(width.ptr + 1, end, options.height) : width;
        if (!separated || height.ec != std::errc() || height.ptr != end || options.width == 0 || options.height == 0)
            throw Error(ExitCode::usage, fmt::format("--size {}: write it as WIDTHxHEIGHT, such as 640x360", size));
        if (options.width > 65536 || options.height > 65536)
            throw Error(ExitCode::usage, fmt::format("--size {}: at most 65536 pixels a side", size));
    }
    for (const std::string& parameter : parameters) options.parameters.push_back(split_assignment(parameter, "-D"));
    for (const std::string& edit : edits) {
        const auto [name, value] = split_assignment(edit, "--param");
        options.edits.push_back({name, value, {}, {}});
    }
    return options;
}

void RenderOptions::add_to(CLI::App& command, bool fixed_integrator) {
    if (!fixed_integrator) {
        command.add_option("-i,--integrator", integrator,
                           help_of("integrator") + ". Default: what the scene asks for, or path");
        command.add_option("--variant", variant, help_of("variant"))->capture_default_str();
    } else {
        integrator = RenderSettings{}.integrator;
    }
    command.add_option("--backend", backend, help_of("backend"))->capture_default_str();
    command.add_option("--precision", precision, help_of("precision"))->capture_default_str();
    command.add_option("--memory", memory, help_of("memory"))->capture_default_str();
    command.add_option("--textures", textures, help_of("textures"))->capture_default_str();
    command.add_option("--seed", seed, help_of("seed"))->capture_default_str();
    command.add_option("--max-depth", max_depth, help_of("max_depth"));
    command.add_flag("--deterministic", deterministic, find_general_setting("deterministic")->what.help);
    command
        .add_option("--set", set,
                    "Any setting of `ambilux help settings`, such as estimator=nee; overrides other options")
        ->allow_extra_args(false)
        ->type_name("KEY=VALUE");
}

RenderSettings RenderOptions::settings(const Scene& scene) const {
    RenderSettings s = default_settings(scene);
    if (!integrator.empty()) apply_setting(s, "integrator", integrator);
    apply_setting(s, "variant", variant);
    apply_setting(s, "backend", backend);
    apply_setting(s, "precision", precision);
    apply_setting(s, "memory", memory);
    apply_setting(s, "textures", textures);
    s.seed = seed;
    if (max_depth) apply_setting(s, "max_depth", std::to_string(*max_depth));
    s.deterministic = deterministic;
    for (const std::string& assignment : set) {
        const auto [key, value] = split_assignment(assignment, "--set");
        apply_setting(s, key, value);
    }
    return s;
}

void check_image_name(const std::string& option, const std::string& path, const std::string& ending) {
    if (path == "-")
        throw Error(ExitCode::usage, fmt::format("{} -: give a name; /dev/stdout is standard output", option));
    std::string has = std::filesystem::path(path).extension();
    for (char& c : has) c = char(std::tolower(static_cast<unsigned char>(c)));
    for (const char* other : {".bmp", ".exr", ".hdr", ".jpeg", ".jpg", ".pfm", ".png", ".ppm", ".tga", ".tif", ".tiff"})
        if (has == other && has != ending)
            throw Error(ExitCode::usage,
                        fmt::format("{} {}: what is written there is no {}; name it {}{}", option, path, has, ending,
                                    ending == ".exr" ? ", and ask for a PNG with --png" : ""));
}

LoadedScene load_scene(const SceneOptions& options, const std::vector<Output>& outputs) {
    check_outputs(outputs);
    check_not_inputs(outputs, {options.path});
    LoadOptions load = options.load_options();
    std::vector<std::string> files;
    load.files = &files;
    LoadTimes times;
    load.times = &times;
    const auto start = std::chrono::steady_clock::now();
    LoadedScene loaded{load_scene_file(options.path, load), 0};
    loaded.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    loaded.times = times;
    check_not_inputs(outputs, files);
    for (const std::string& warning : loaded.scene.warnings) log_warning(warning);
    for (const std::string& note : loaded.scene.notes) log_info("note: " + note);
    return loaded;
}

void write_json(const std::string& path, const nlohmann::json& json) {
    // Text from files need not be valid UTF-8; it must not make the result unreadable.
    const std::string text = json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
    if (path != "-") return write_file_atomic(path, text);
    std::cout << text << std::flush;
    if (!std::cout) throw Error(ExitCode::device, "cannot write to standard output");
}

std::string progress_details(uint64_t samples, double seconds, const RenderStats& stats) {
    const double rays = double(stats.rays_extend) + double(stats.rays_occlude);
    return fmt::format("{} spp  {}rays/s", samples, format_count(seconds > 0 ? rays / seconds : 0));
}

}  // namespace ambilux
