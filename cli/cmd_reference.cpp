#include <fmt/format.h>

#include <cmath>

#include "cli/commands.h"
#include "cli/interrupt.h"
#include "core/error.h"
#include "core/log.h"
#include "core/progress.h"
#include "experiments/reference_store.h"
#include "film/png_io.h"
#include "session/reference.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

struct ReferenceArguments {
    SceneOptions scene;
    RenderOptions render;
    std::string output, png, json;
    uint64_t spp = 0;
};

int reference(const ReferenceArguments& o) {
    if (o.output.empty()) throw Error(ExitCode::usage, "-o: the reference needs a name");
    check_image_name("-o", o.output, ".exr");
    check_image_name("--png", o.png, ".png");
    const LoadedScene loaded = load_scene(o.scene, {{"-o", o.output}, {"--png", o.png}, {"--json", o.json}});
    ReferenceRequest request = reference_request(o.output, o.spp, o.render.settings(loaded.scene));
    const ReferenceLock lock(o.output, nullptr);
    Hooks hooks = default_hooks();
    hooks.make_renderer = [&](const Scene& scene, const RenderSettings& settings) {
        std::unique_ptr<Renderer> renderer = make_renderer(scene, settings);
        request.interrupt = save_when_interrupted();
        return renderer;
    };

    ReferenceResult result;
    {
        Progress progress("reference");
        uint64_t first = 0;
        bool started = false;
        request.on_batch = [&](const RenderPosition& p) {
            if (!started) {
                started = true;
                first = p.samples;
            }
            const double rate = p.seconds > 0 ? double(p.samples - first) / p.seconds : 0;
            progress.update(double(p.samples) / double(o.spp), fmt::format("{} spp", p.samples),
                            rate > 0 ? double(o.spp - p.samples) / rate : INFINITY);
        };
        result = make_reference(loaded.scene, request, hooks);
    }
    if (!o.png.empty() && result.reference.samples) write_png(o.png, result.reference.mean);
    double noise = 0;
    for (const float se : result.reference.standard_error.rgb) noise += double(se) * double(se);
    noise = std::sqrt(noise / double(std::max<size_t>(1, result.reference.standard_error.rgb.size())));
    if (!o.json.empty()) {
        nlohmann::json json = stats_json(loaded.scene, request.settings, result.stats, loaded.seconds);
        json["spp"] = result.reference.samples;
        json["continued_from"] = result.continued_from;
        json["reference_noise"] = std::isfinite(noise) ? nlohmann::json(noise) : nlohmann::json(nullptr);
        json["interrupted"] = result.interrupted;
        write_json(o.json, json);
    }
    if (result.interrupted) {
        log_error(fmt::format("interrupted: {} holds {} of {} samples per pixel; the same command continues it",
                              o.output, result.reference.samples, o.spp));
        return int(ExitCode::interrupted);
    }
    if (result.continued_from >= o.spp)
        log_info(fmt::format("{}: nothing to do, it holds {} samples per pixel", o.output, result.continued_from));
    else
        log_info(fmt::format(
            "{}: {} spp{}, standard error {:.3g} (root mean square)", o.output, result.reference.samples,
            result.continued_from ? fmt::format(", {} of them from before", result.continued_from) : "", noise));
    if (result.stats.invalid.total())
        log_warning(
            fmt::format("{} invalid values were dropped: see the statistics (--json)", result.stats.invalid.total()));
    return int(ExitCode::done);
}

}  // namespace

void add_reference(CLI::App& app, Run& run) {
    auto o = std::make_shared<ReferenceArguments>();
    CLI::App& command = *app.add_subcommand("reference",
                                            "Ground truth with its standard error, by the path tracer or with --set "
                                            "integrator=bdpt; continues an existing file");
    o->scene.add_to(command);
    o->render.add_to(command, true);
    command.add_option("-o,--output", o->output, "Reference to write or to continue (EXR)")->required();
    command.add_option("--spp", o->spp, "Samples per pixel in total")->required();
    command.add_option("--png", o->png, "Write an sRGB PNG as well");
    command.add_option("--json", o->json, "Write the statistics to a file, or - for standard output");
    command.callback([o, &run] { run = [o] { return reference(*o); }; });
}

}  // namespace ambilux
