#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

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
#include "core/ranks.h"
#include "film/exr_io.h"
#include "film/png_io.h"
#include "integrators/registry.h"
#include "integrators/warnings.h"
#include "session/aovs.h"
#include "session/kept_film.h"
#include "session/parallel/parallel_render.h"
#include "session/render_plan.h"
#include "session/replays.h"
#include "session/statistics.h"
#include "session/technique_files.h"

namespace ambilux {
namespace {

struct RenderArguments {
    SceneOptions scene;
    RenderOptions render;
    std::string output, png, json, techniques, tev;
    std::optional<uint64_t> spp;
    std::optional<double> time;
    std::optional<float> exposure;
    std::vector<std::string> aovs;
    uint32_t outliers = 0;
    bool strict = false;
    std::vector<std::string> devices;
    std::optional<uint32_t> range_size, block_films;
    std::optional<double> checkpoint;
    bool resume = false;

    /// By ranges of samples, on several devices or with checkpoints (session/parallel/).
    bool by_ranges() const {
        return !devices.empty() || range_size || block_films || checkpoint || resume || ranks().launched();
    }
};

constexpr float kMostStops = 100;
constexpr std::chrono::milliseconds kStreamPeriod(500);

void check(const RenderArguments& o) {
    render_budget(o.spp, o.time, {}, "--");
    if (o.exposure && !(std::fabs(*o.exposure) <= kMostStops))
        throw Error(ExitCode::usage, fmt::format("--exposure: {} stops at most, up or down", kMostStops));
    if (o.exposure && o.png.empty())
        throw Error(ExitCode::usage, "--exposure changes only the PNG: give --png FILE as well");
    if (o.output.empty()) throw Error(ExitCode::usage, "-o: the image needs a name");
    check_image_name("-o", o.output, ".exr");
    check_image_name("--png", o.png, ".png");
    check_aovs(o.aovs, "--");
    if (!o.techniques.empty()) {
        make_folders(o.techniques);
        check_writable(o.techniques + "/techniques.json");
    }
    if (!o.by_ranges()) return;
    if (o.range_size && *o.range_size == 0) throw Error(ExitCode::usage, "--range-size: at least one sample is needed");
    if (o.block_films && *o.block_films == 0)
        throw Error(ExitCode::usage, "--block-films: at least one film is needed");
    if (o.checkpoint && !(*o.checkpoint > 0))
        throw Error(ExitCode::usage, "--checkpoint: more than zero seconds are needed");
    for (const auto& [option, given] : {std::pair("--outliers", o.outliers > 0),
                                        {"--technique-images", !o.techniques.empty()},
                                        {"--tev", !o.tev.empty()}})
        if (given)
            throw Error(ExitCode::usage,
                        fmt::format("{} works on one device without checkpoints: leave --devices, --range-size, "
                                    "--checkpoint, --resume and mpirun out",
                                    option));
}

/// What writing the image takes: sums of its pixels, the image, and the file twice while it grows.
size_t bytes_to_save(const Scene& scene) {
    constexpr size_t kPerPixel = 3 * (2 * sizeof(double) + 3 * sizeof(float)), kRest = 16 << 20;
    return size_t(scene.sensor.crop_width) * scene.sensor.crop_height * kPerPixel + kRest;
}

void write_images(const RenderArguments& o, const Scene& scene, const RenderSettings& settings,
                  const RenderStats& stats, const FilmMoments& film) {
    const Image image = mean_image(film);
    write_exr(o.output, image, image_attributes(scene, settings, stats),
              make_aovs(scene, used_settings(settings, stats), film, o.aovs));
    if (!o.png.empty()) write_png(o.png, image, o.exposure.value_or(0.0f));
}

/// Statistics with what `found` adds to them, and the last words.
int conclude(const RenderArguments& o, const LoadedScene& loaded, const RenderSettings& settings,
             const RenderStats& stats, const RenderPosition& position, const nlohmann::json& found) {
    if (!o.json.empty()) {
        nlohmann::json json = stats_json(loaded.scene, settings, stats, loaded.seconds);
        json.update(found);
        json["interrupted"] = position.interrupted;
        json["iteration_samples"] = position.iteration_samples;
        write_json(o.json, json);
    }
    if (position.interrupted) {
        log_error(position.samples ? fmt::format("interrupted: {} holds the {} samples per pixel that were finished",
                                                 o.output, position.samples)
                                   : "interrupted before the first sample was finished: nothing was saved");
        return int(ExitCode::interrupted);
    }
    const std::string bias = bias_text(used_settings(settings, stats));
    log_info(fmt::format("{}: {} spp in {}, {}{}", o.output, position.samples, format_duration(position.seconds),
                         stats.device, bias.empty() ? "" : "; " + bias));
    if (const std::string text = lost_values(stats); o.strict && !text.empty())
        throw Error(ExitCode::device, "--strict: " + text + ". The image was saved");
    return int(ExitCode::done);
}

/// The scene, its warnings said.
LoadedScene load(const RenderArguments& o) {
    LoadedScene loaded = load_scene(o.scene, {{"-o", o.output}, {"--png", o.png}, {"--json", o.json}});
    if (o.strict && !loaded.scene.warnings.empty())
        throw Error(ExitCode::bad_input, "--strict: the scene has warnings, nothing was rendered");
    return loaded;
}

void show_progress(Progress& progress, const Budget& budget, const RenderPosition& p, const RenderStats& stats) {
    const double fraction = budget.samples ? double(p.samples) / double(budget.samples) : p.seconds / budget.seconds;
    progress.update(std::min(fraction, 1.0), progress_details(p.samples, p.seconds, stats));
}

nlohmann::json describe_parts(const ParallelResult& result) {
    nlohmann::json workers = nlohmann::json::array();
    for (const WorkerShare& w : result.workers)
        workers.push_back({{"rank", w.rank},
                           {"host", w.host},
                           {"device", w.device},
                           {"samples", w.samples},
                           {"ranges", w.ranges},
                           {"busy_seconds", w.seconds}});
    return {{"workers", workers},
            {"range_size", result.ranges.size},
            {"merge_seconds", result.merge_seconds},
            {"receive_seconds", result.receive_seconds}};
}

int render_by_ranges(const RenderArguments& o) {
    const LoadedScene loaded = load(o);
    ParallelRequest request;
    request.settings = o.render.settings(loaded.scene);
    check_aovs_of(request.settings, o.aovs, "--");
    request.budget = render_budget(o.spp, o.time, loaded.scene, "--");
    expect(request.settings, request.budget);
    request.devices = o.devices;
    request.range_size = o.range_size.value_or(0);
    request.block_nodes = o.block_films.value_or(0);
    request.state_path = o.output + ".state";
    request.resume = o.resume;
    request.checkpoint_seconds = o.checkpoint.value_or(request.checkpoint_seconds);
    request.interrupt = save_when_interrupted();
    if (ranks().rank() > 0) {
        serve_parallel(loaded.scene, request, ranks());
        return int(ExitCode::done);
    }
    MemoryReserve reserve(bytes_to_save(loaded.scene));
    ParallelResult result;
    {
        Progress progress("render");
        request.on_progress = [&](const RenderPosition& p, const RenderStats& stats) {
            show_progress(progress, request.budget, p, stats);
        };
        result = render_parallel(loaded.scene, request, ranks());
    }
    reserve.release();
    if (!result.state_path.empty())
        log_error(fmt::format(
            "stopped by a signal{}: {} samples per pixel are in {}; the same command with --resume goes on",
            ranks().size() > 1 ? ", or because another rank ended" : "", result.position.samples, result.state_path));
    for (const std::string& warning : render_warnings(loaded.scene, used_settings(request.settings, result.stats)))
        log_warning(warning);
    if (result.position.samples > 0) write_images(o, loaded.scene, request.settings, result.stats, result.film);
    if (const std::string text = lost_values(result.stats); !o.strict && !text.empty()) log_warning(text);
    return conclude(o, loaded, request.settings, result.stats, result.position, describe_parts(result));
}

/// A device failed: saves what was finished, and says so in the message that ends the program.
[[noreturn]] void save_after_fault(const RenderArguments& o, const Scene& scene, const RenderSettings& settings,
                                   KeptFilm& kept, const Error& fault) {
    const KeptFilm::Finished finished = kept.last();
    if (finished.film.samples == 0) throw fault;
    write_images(o, scene, settings, finished.stats, finished.film);
    throw Error(fault.code, fmt::format("{}. {} holds the {} samples per pixel that were finished", fault.what(),
                                        o.output, finished.film.samples));
}

/// A renderer, and what looks at its samples on the way.
struct Watched {
    std::unique_ptr<Renderer> renderer;
    InvalidWatch* invalid = nullptr;
    const SampleWatch* samples = nullptr;  ///< with --outliers
};

Watched make_watched(const RenderArguments& o, const Scene& scene, const RenderSettings& settings) {
    auto invalid = std::make_unique<InvalidWatch>(make_renderer(scene, settings));
    Watched watched;
    watched.invalid = invalid.get();
    watched.renderer = std::move(invalid);
    if (o.outliers == 0) return watched;
    auto samples = watch_samples(std::move(watched.renderer), settings, "--");
    watched.samples = samples.get();
    watched.renderer = std::move(samples);
    return watched;
}

/// With --tev: the image so far, now and then.
class Preview {
public:
    Preview(const RenderArguments& o, const Sensor& sensor) {
        if (!o.tev.empty()) tev_.emplace(o.tev, o.output, sensor.crop_width, sensor.crop_height);
    }
    void look(Renderer& renderer) {
        const auto now = std::chrono::steady_clock::now();
        if (!tev_ || now - sent_ <= kStreamPeriod) return;
        tev_->send(mean_image(renderer.film()));
        sent_ = now;
    }
    void show(const FilmMoments& film) {
        if (tev_) tev_->send(mean_image(film));
    }

private:
    std::optional<TevStream> tev_;
    std::chrono::steady_clock::time_point sent_ = std::chrono::steady_clock::now();
};

struct Rendered {
    RenderPosition position;
    RenderStats stats;
    FilmMoments film;
};

Rendered render_samples(const RenderArguments& o, const Scene& scene, const RenderSettings& settings,
                        const Budget& budget, Renderer& renderer, Preview& preview) {
    MemoryReserve reserve(bytes_to_save(scene));
    const volatile bool* const interrupt = save_when_interrupted();
    Rendered out;
    out.position = first_position(renderer);
    out.stats = renderer.stats();
    if (const SelectionStats& selection = out.stats.selection; !selection.name.empty())
        log_info(fmt::format("bdpt.auto: {}, after {}. To repeat it: {}", selection.name,
                             format_duration(selection.seconds), selection_line(selection)));
    KeptFilm kept(renderer);
    const bool on_device = out.stats.backend == "cuda";
    try {
        Progress progress("render");
        out.position = drive(renderer, out.position, budget, interrupt, [&](const RenderPosition& p) {
            out.stats = renderer.stats();
            show_progress(progress, budget, p, out.stats);
            if (on_device) kept.look(out.stats);
            preview.look(renderer);
        });
        reserve.release();
        out.stats = renderer.stats();
        if (out.position.samples > 0) out.film = renderer.film();
    } catch (const Error& fault) {
        if (!on_device || fault.code != ExitCode::device) throw;
        reserve.release();
        save_after_fault(o, scene, settings, kept, fault);
    }
    return out;
}

/// What the watches found, for the statistics. Invalid values are no reason to fail.
nlohmann::json find(const RenderArguments& o, const Scene& scene, const RenderSettings& settings,
                    const RenderStats& stats, const Watched& watched) {
    if (!watched.samples && watched.invalid->batches().empty()) return nlohmann::json::object();
    FinishedRender finished = {o.scene, scene, used_settings(settings, stats), *watched.invalid, watched.samples};
    apply_setting(finished.used, "backend", stats.backend);
    try {
        return report_findings(finished, o.outliers, o.json == "-", save_when_interrupted());
    } catch (const Error& e) {
        if (watched.samples) throw;
        log_warning(e.what());
        return nlohmann::json::object();
    }
}

int render(const RenderArguments& o) {
    check(o);
    if (o.by_ranges()) return render_by_ranges(o);
    const LoadedScene loaded = load(o);
    const Scene& scene = loaded.scene;
    RenderSettings settings = o.render.settings(scene);
    check_aovs_of(settings, o.aovs, "--");
    if (!o.techniques.empty() && settings.technique_depth == 0) settings.technique_depth = kDefaultTechniqueDepth;
    const Budget budget = render_budget(o.spp, o.time, scene, "--");
    expect(settings, budget);
    const Watched watched = make_watched(o, scene, settings);
    Preview preview(o, scene.sensor);
    for (const std::string& warning : render_warnings(scene, used_settings(settings, watched.renderer->stats())))
        log_warning(warning);

    const auto [position, stats, film] = render_samples(o, scene, settings, budget, *watched.renderer, preview);
    nlohmann::json found = nlohmann::json::object();
    if (position.samples > 0) {
        preview.show(film);
        write_images(o, scene, settings, stats, film);
        if (!o.techniques.empty())
            write_technique_images(o.techniques, scene, settings, stats, watched.renderer->strategy_images());
    }
    if (const std::string text = lost_values(stats); !o.strict && !text.empty()) log_warning(text);
    if (position.samples > 0) found = find(o, scene, settings, stats, watched);
    return conclude(o, loaded, settings, stats, position, found);
}

}  // namespace

void add_render(CLI::App& app, Run& run) {
    auto o = std::make_shared<RenderArguments>();
    CLI::App& command = *app.add_subcommand("render", "Render a scene to an OpenEXR image");
    o->scene.add_to(command);
    o->render.add_to(command, false);
    command.add_option("-o,--output", o->output, "Image to write (EXR)")->required();
    CLI::Option* png =
        command.add_option("--png", o->png, "Write an sRGB PNG as well; without a FILE, beside the image")
            ->expected(0, 1)
            ->type_name("[FILE]");
    command.add_option("--exposure", o->exposure, "Stops by which the PNG is brightened");
    command.add_option("--spp", o->spp, "Samples per pixel. Default: the scene's");
    command.add_option("--time", o->time, "Seconds of wall clock to render instead of --spp");
    command
        .add_option(
            "--technique-images", o->techniques,
            "Folder for raw and weighted images of every strategy (s,t) up to 6 segments, or --set technique_depth=N")
        ->type_name("DIR");
    command
        .add_option("--aov", o->aovs,
                    "Additional layers of the image: " + fmt::format("{}", fmt::join(known_aovs(), ", ")))
        ->delimiter(',')
        ->type_name("NAME,...");
    command.add_option("--outliers", o->outliers,
                       "List N pixels by the largest difference between one sample and the mean of the pixel's other "
                       "samples, with commands that replay them; renders one sample at a time");
    command.add_option("--tev", o->tev, "Show the image so far in a running tev, twice a second")
        ->type_name("HOST:PORT");
    command
        .add_option("--devices", o->devices,
                    "Devices that share the render: numbers of CUDA devices, or cpu; with mpirun, of each rank")
        ->delimiter(',')
        ->type_name("N,...");
    command.add_option(
        "--range-size", o->range_size,
        "Samples per pixel that a device renders before it hands over its film (a range). The image does "
        "not depend on which device renders a range");
    command.add_option("--block-films", o->block_films,
                       "Films that a rank adds up before it sends their sum to the first rank; 1: the first rank gets "
                       "each film. Default: 1 below 16 ranks, else about the root of their number. The image does not "
                       "depend on it");
    command.add_option(
        "--checkpoint", o->checkpoint,
        "Seconds between two saved states of the render, OUTPUT.state. Default with several devices: 60");
    command.add_flag("--resume", o->resume, "Continue from OUTPUT.state, with any number of devices and ranks");
    command.add_flag(
        "--strict", o->strict,
        "Fail (exit code 4) if invalid values or lost queue items were counted, and (3) if the scene has warnings");
    command.add_option("--json", o->json, "Write the statistics to a file, or - for standard output");
    command.callback([o, png, &run] {
        if (png->count() > 0 && o->png.empty())
            o->png = std::filesystem::path(o->output).replace_extension(".png").string();
        run = [o] { return render(*o); };
    });
}

}  // namespace ambilux
