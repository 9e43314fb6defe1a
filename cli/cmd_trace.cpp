#include <fmt/format.h>

#include <charconv>
#include <iostream>

#include "cli/commands.h"
#include "core/error.h"
#include "film/exr_io.h"
#include "render/replay/print.h"
#include "render/replay/replay.h"
#include "session/guide_tree.h"
#include "session/replays.h"

namespace ambilux {
namespace {

struct TraceArguments {
    SceneOptions scene;
    RenderOptions render;
    std::string pixel, strategy, json, guide, guide_side = "eye";
    std::optional<uint32_t> sample, light_subpath;
    bool compare = false;
};

/// "X,Y" within the image.
void parse_pixel(const std::string& text, const Sensor& sensor, ReplayRequest& request) {
    const char* const end = text.data() + text.size();
    const auto x = std::from_chars(text.data(), end, request.x);
    const bool separated = x.ec == std::errc() && x.ptr != end && *x.ptr == ',';
    const auto y = separated ? std::from_chars(x.ptr + 1, end, request.y) : x;
    if (!separated || y.ec != std::errc() || y.ptr != end)
        throw Error(ExitCode::usage, fmt::format("--pixel {}: write it as X,Y, such as 12,30", text));
    if (request.x >= sensor.crop_width || request.y >= sensor.crop_height)
        throw Error(ExitCode::usage,
                    fmt::format("--pixel {}: the image has {}x{} pixels, counted from 0,0 at the top left", text,
                                sensor.crop_width, sensor.crop_height));
}

/// Adds what a render brings to the sample.
void compare(const Scene& scene, const RenderSettings& settings, const ReplayRequest& request, SharedAccels& accels,
             nlohmann::json& json, std::string& text) {
    const std::vector<LengthComparison> lengths =
        compare_by_length(scene, settings, request, accels,
                          [&](const RenderSettings& s, uint32_t sample) { return rendered_film(scene, s, sample); });
    text += by_length_text(lengths);
    json["by_segments"] = by_length_json(lengths);
}

/// Pictures of what was learned where the eye subpath met something, one layer a vertex, and statistics of the trees.
void show_guide(const Replay& replay, const Scene& scene, const ReplaySample& sample, const std::string& path,
                const std::string& side, nlohmann::json& json, std::string& text) {
    const std::shared_ptr<const GuidedState> guide = guide_of(replay, sample.sample, side, "--");
    json["guide"] = guide_json(guide_arrays(*guide, scene), *guide);
    text += guide_text(json["guide"]);
    std::vector<Layer> layers;
    for (const ReplayVertex& v : sample.eye.vertices)
        if (!v.miss) layers.push_back(guide_layer(*guide, v.p, fmt::format("vertex{}", v.depth)));
    if (layers.empty()) throw Error(ExitCode::usage, "--guide: the eye subpath meets nothing");
    Image first = {kGuidePictureWidth, kGuidePictureHeight, {}};
    for (const float density : layers[0].values) first.rgb.insert(first.rgb.end(), 3, density);
    write_exr(path, first, {}, layers);
}

int trace(const TraceArguments& o) {
    if (o.pixel.empty() && !o.light_subpath)
        throw Error(ExitCode::usage, "trace: --pixel X,Y or --light-subpath N is needed, or both");
    if (o.compare && (o.pixel.empty() || o.light_subpath))
        throw Error(ExitCode::usage, "--compare: --pixel X,Y is needed, without --light-subpath");
    if (!o.guide.empty() && o.pixel.empty()) throw Error(ExitCode::usage, "--guide: --pixel X,Y is needed");
    ReplayFormat format;
    if (!o.strategy.empty()) format.only = parse_strategy(o.strategy);
    const LoadedScene loaded = load_scene(o.scene, {{"--json", o.json}, {"--guide", o.guide}});
    format.origin = loaded.scene.origin;
    ReplayRequest request;
    if (!o.pixel.empty()) parse_pixel(o.pixel, loaded.scene.sensor, request);
    request.sample = *o.sample;
    request.light_subpath = o.light_subpath;
    SharedAccels accels(loaded.scene);
    RenderSettings settings = o.render.settings(loaded.scene);
    if (settings.backend == Backend::automatic) settings.backend = Backend::cpu;
    const std::unique_ptr<Replay> replay = make_replay(loaded.scene, settings, accels);
    const auto report = [&](const auto&... seen) {
        nlohmann::json json = replay_json(seen..., format);
        std::string text = replay_text(seen..., format);
        if constexpr (sizeof...(seen) == 1)
            if (!o.guide.empty()) show_guide(*replay, loaded.scene, seen..., o.guide, o.guide_side, json, text);
        if (o.compare) compare(loaded.scene, settings, request, accels, json, text);
        if (!o.json.empty()) write_json(o.json, json);
        if (o.json != "-") std::cout << text << std::flush;
    };
    if (!o.pixel.empty()) {
        report(replay->sample(request));
    } else {
        std::vector<ReplayCandidate> splats;
        const ReplaySubpath subpath = replay->light_subpath(*o.light_subpath, request.sample, true, splats);
        report(subpath, splats);
    }
    return int(ExitCode::done);
}

}  // namespace

void add_trace(CLI::App& app, Run& run) {
    auto o = std::make_shared<TraceArguments>();
    CLI::App& command = *app.add_subcommand(
        "trace", "Replay one sample of a render on the CPU: vertices, densities, weights, contributions");
    o->scene.add_to(command);
    o->render.add_to(command, false);
    command.get_option("--backend")
        ->description("Backend of the render, cpu or cuda: for cuda the replay's rays go through the same structure");
    command.add_option("--pixel", o->pixel, "Pixel X,Y of the image, from 0,0 at the top left");
    command.add_option("--sample", o->sample, "Sample of the pixel, from 0")->required();
    command.add_option("--light-subpath", o->light_subpath,
                       "Number of a light subpath of the sample, to show too, or, without --pixel, alone");
    command.add_option("--strategy", o->strategy,
                       "Show contributions of this strategy only, such as s1t3, or s2+t3 for merges");
    command.add_flag("--compare", o->compare,
                     "Render the sample as well (with --backend cuda on the device), and print the number of segments "
                     "from which on it differs from the replay");
    command.add_option(
        "--guide", o->guide,
        "Variants guided: write pictures (EXR) of the densities that were learned at the vertices of the "
        "eye subpath, and print what the trees are like");
    command.add_option(
        "--guide-side", o->guide_side,
        "With --guide: trees that eye subpaths follow (eye, incident radiance) or light subpaths (light, importance)");
    command.add_option("--json", o->json, "Write the replay to a file, or - for standard output");
    command.callback([o, &run] { run = [o] { return trace(*o); }; });
}

}  // namespace ambilux
