#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>

#include "cli/aovs.h"
#include "cli/commands.h"
#include "cli/findings.h"
#include "cli/interrupt.h"
#include "cli/tev.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "core/log.h"
#include "core/memory_reserve.h"
#include "core/outputs.h"
#include "core/progress.h"
#include "experiments/render_plan.h"
#include "experiments/statistics.h"
#include "experiments/technique_files.h"
#include "film/exr_io.h"
#include "film/png_io.h"
#include "integrators/warnings.h"

namespace ambilux {
namespace {

struct Options {
    SceneOptions scene;
    RenderOptions render;
    std::string output, png, json, techniques, tev;
    std::optional<uint64_t> spp;
    std::optional<double> time;
    std::optional<float> exposure;
    std::vector<std::string> aovs;
    uint32_t outliers = 0;
    bool strict = false;
};

constexpr float kMostStops = 100;
constexpr std::chrono::milliseconds kStreamPeriod(500);

void check(const Options& o) {
    render_budget(o.spp, o.time, {}, "--");
    if (o.exposure && !(std::fabs(*o.exposure) <= kMostStops))
        throw Error(ExitCode::usage, fmt::format("--exposure: {} stops at most, up or down", kMostStops));
    if (o.exposure && o.png.empty())
        throw Error(ExitCode::usage, "--exposure changes only the PNG: give --png FILE as well");
    if (o.output.empty()) throw Error(ExitCode::usage, "-o: the image needs a name");
    check_aovs(o.aovs);
    if (!o.techniques.empty()) {
        make_folders(o.techniques);
        check_writable(o.techniques + "/techniques.json");
    }
}

/// What writing the image takes: sums of its pixels, the image, and the file twice while it grows.
size_t bytes_to_save(const Scene& scene) {
    constexpr size_t kPerPixel = 3 * (2 * sizeof(double) + 3 * sizeof(float)), kRest = 16 << 20;
    return size_t(scene.sensor.crop_width) * scene.sensor.crop_height * kPerPixel + kRest;
}

int render(const Options& o) {
    check(o);
    const LoadedScene loaded = load_scene(o.scene, {{"-o", o.output}, {"--png", o.png}, {"--json", o.json}});
    RenderSettings settings = o.render.settings(loaded.scene);
    if (!o.techniques.empty() && settings.technique_depth == 0) settings.technique_depth = kDefaultTechniqueDepth;
    const Budget budget = render_budget(o.spp, o.time, loaded.scene, "--");
    expect(settings, budget);
    auto watched = std::make_unique<InvalidWatch>(make_renderer(loaded.scene, settings));
    InvalidWatch& watch = *watched;
    std::unique_ptr<Renderer> renderer = std::move(watched);
    const SampleWatch* samples = nullptr;
    if (o.outliers > 0) {
        check_replay(used_settings(settings, renderer->stats()));
        auto looked_at = std::make_unique<SampleWatch>(std::move(renderer));
        samples = looked_at.get();
        renderer = std::move(looked_at);
    }

    std::optional<TevStream> tev;
    if (!o.tev.empty()) tev.emplace(o.tev, o.output, loaded.scene.sensor.crop_width, loaded.scene.sensor.crop_height);
    auto streamed = std::chrono::steady_clock::now();

    for (const std::string& warning : render_warnings(loaded.scene, used_settings(settings, renderer->stats())))
        log_warning(warning);

    MemoryReserve reserve(bytes_to_save(loaded.scene));
    const volatile bool* const interrupt = save_when_interrupted();
    RenderPosition position = first_position(*renderer);
    if (const SelectionStats choice = renderer->stats().choice; !choice.name.empty())
        log_info(fmt::format("bdpt.auto: {}, after {}. To repeat it: {}", choice.name, format_duration(choice.seconds),
                             choice_line(choice)));
    {
        Progress progress("render");
        position = drive(*renderer, position, budget, interrupt, [&](const RenderPosition& p) {
            const double fraction =
                budget.samples ? double(p.samples) / double(budget.samples) : p.seconds / budget.seconds;
            progress.update(std::min(fraction, 1.0), progress_details(p.samples, p.seconds, renderer->stats()));
            if (const auto now = std::chrono::steady_clock::now(); tev && now - streamed > kStreamPeriod) {
                tev->send(mean_image(renderer->film()));
                streamed = now;
            }
        });
    }

    reserve.release();
    RenderStats stats = renderer->stats();
    if (position.samples > 0) {
        const Image image = mean_image(renderer->film());
        if (tev) tev->send(image);
        write_exr(o.output, image, image_attributes(loaded.scene, settings, stats),
                  make_aovs(loaded.scene, settings, renderer->film(), o.aovs));
        if (!o.png.empty()) write_png(o.png, image, o.exposure.value_or(0.0f));
    }
    if (position.samples > 0 && !o.techniques.empty())
        write_technique_images(o.techniques, loaded.scene, settings, stats, renderer->strategy_images());
    if (const std::string text = lost_values(stats); !o.strict && !text.empty()) log_warning(text);
    nlohmann::json found = nlohmann::json::object();
    if (position.samples > 0 && (samples || !watch.batches().empty())) {
        FinishedRender finished = {o.scene, loaded.scene, used_settings(settings, stats), watch, samples};
        apply_setting(finished.used, "backend", stats.backend);
        try {
            found = report_findings(finished, o.outliers, o.json == "-", interrupt);
        } catch (const Error& e) {
            if (samples) throw;
            log_warning(e.what());
        }
    }
    if (!o.json.empty()) {
        nlohmann::json json = stats_json(loaded.scene, settings, stats, loaded.seconds);
        json.update(found);
        json["interrupted"] = position.interrupted;
        write_json(o.json, json);
    }
    if (position.interrupted) {
        log_error(position.samples ? fmt::format("interrupted: {} holds the {} samples per pixel that were finished",
                                                 o.output, position.samples)
                                   : "interrupted before the first sample was finished: nothing was saved");
        return int(ExitCode::interrupted);
    }
    log_info(fmt::format("{}: {} spp in {}, {}", o.output, position.samples, format_duration(position.seconds),
                         stats.device));
    if (const std::string text = lost_values(stats); o.strict && !text.empty())
        throw Error(ExitCode::device, "--strict: " + text + ". The image was saved");
    return int(ExitCode::done);
}

}  // namespace

void add_render(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    CLI::App& command = *app.add_subcommand("render", "Render a scene to an OpenEXR image");
    o->scene.add_to(command);
    o->render.add_to(command, false);
    command.add_option("-o,--output", o->output, "Image to write (EXR)")->required();
    CLI::Option* png =
        command.add_option("--png", o->png, "Write an sRGB PNG as well; without a FILE, beside the image")
            ->expected(0, 1)
            ->type_name("[FILE]");
    command.add_option("--exposure", o->exposure, "Stops by which the PNG is brightened");
    command.add_option("--spp", o->spp, "Samples per pixel. Default: the scene's")->check(refuse_negative);
    command.add_option("--time", o->time, "Seconds of wall clock to render instead of --spp");
    command
        .add_option(
            "--technique-images", o->techniques,
            "Folder for raw and weighted images of every strategy (s,t) up to 6 segments, or --set technique_depth=N")
        ->type_name("DIR");
    command
        .add_option("--aov", o->aovs,
                    "Layers that the image gets besides: " + fmt::format("{}", fmt::join(known_aovs(), ", ")))
        ->delimiter(',')
        ->type_name("NAME,...");
    command.add_option("--outliers", o->outliers,
                       "List the N pixels whose largest sample exceeds the mean of their others most, with commands "
                       "that replay them; renders one sample at a time");
    command.add_option("--tev", o->tev, "Show the image so far in a running tev, twice a second")
        ->type_name("HOST:PORT");
    command.add_flag("--strict", o->strict, "Fail (exit code 4) if invalid values or lost queue items were counted");
    command.add_option("--json", o->json, "Write the statistics to a file, or - for standard output");
    command.callback([o, png, &run] {
        if (png->count() > 0 && o->png.empty())
            o->png = std::filesystem::path(o->output).replace_extension(".png").string();
        run = [o] { return render(*o); };
    });
}

}  // namespace ambilux
