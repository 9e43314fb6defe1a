#include <fmt/format.h>

#include <iostream>

#include "backends/bench_queues.h"
#include "backends/bench_rays.h"
#include "cli/commands.h"
#include "cli/interrupt.h"
#include "core/error.h"
#include "core/log.h"
#include "core/progress.h"
#include "render/fused_shares.h"
#include "session/bench_frames.h"
#include "session/drive.h"
#include "session/statistics.h"

namespace ambilux {
namespace {

struct BenchArguments {
    SceneOptions scene;
    RenderOptions render;
    std::string json;
    std::string backend = "auto";
    int repetitions = 25;
    uint32_t items = 0;
    bool opaque = false;
    uint32_t spp = 16;
    bool unfused = false;
    uint32_t frames = 100;
};

/// A table of objects that hold numbers or text.
void print_rows(const nlohmann::json& rows) {
    for (const auto& [key, value] : rows[0].items()) std::cout << fmt::format("{:>18}", key);
    std::cout << "\n";
    for (const auto& row : rows) {
        for (const auto& [key, value] : row.items())
            std::cout << fmt::format("{:>18}", value.is_number_float() ? fmt::format("{:.4g}", value.get<double>())
                                               : value.is_string()     ? value.get<std::string>()
                                                                       : value.dump());
        std::cout << "\n";
    }
}

int report(const BenchArguments& o, const nlohmann::json& json) {
    if (!o.json.empty()) write_json(o.json, json);
    if (o.json == "-") return int(ExitCode::done);
    for (const auto& [key, value] : json.items()) {
        if (value.is_array() && !value.empty() && value[0].is_object()) {
            std::cout << key << ":\n";
            print_rows(value);
        } else {
            std::cout << fmt::format("{}: {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
        }
    }
    return int(ExitCode::done);
}

void check_repetitions(const BenchArguments& o) {
    if (o.repetitions < 1) throw Error(ExitCode::usage, "--repetitions: at least 1 is needed");
}

int rays(const BenchArguments& o) {
    check_repetitions(o);
    return report(o, bench_rays(load_scene(o.scene, {{"--json", o.json}}).scene, o.backend, o.repetitions, o.opaque));
}

int queues(const BenchArguments& o) {
    check_repetitions(o);
    return report(o, bench_queues(load_scene(o.scene, {{"--json", o.json}}).scene, o.backend, o.items, o.repetitions));
}

/// A render of `spp` samples of every pixel.
RenderPosition render(const BenchArguments& o, Renderer& renderer) {
    Progress progress("bench stages");
    return drive(renderer, {}, {o.spp, 0}, save_when_interrupted(), [&](const RenderPosition& p) {
        progress.update(double(p.samples) / o.spp, progress_details(p.samples, p.seconds, renderer.stats()));
    });
}

/// What the shares of fused stages are, in words.
constexpr const char* kShares =
    "shares of a render with fuse=none, whose kernels hold all features and go through queues: an estimate";

std::string shares_table(const std::vector<FusedShare>& shares, double fused, double unfused) {
    std::string table = fmt::format("\n{}\nrender {:.4f} s, with fuse=none {:.4f} s\n{:<16} {:<16} {:>10} {:>7}\n",
                                    kShares, fused, unfused, "inside", "stage", "seconds", "share");
    for (const FusedShare& s : shares)
        table += fmt::format("{:<16} {:<16} {:>10.4f} {:>6.1f}%\n", s.inside, s.stage, s.seconds, 100 * s.share);
    return table;
}

nlohmann::json shares_json(const std::vector<FusedShare>& shares, double unfused) {
    nlohmann::json rows = nlohmann::json::array();
    for (const FusedShare& s : shares)
        rows.push_back({{"inside", s.inside}, {"name", s.stage}, {"seconds", s.seconds}, {"share", s.share}});
    return {{"how", kShares}, {"unfused_seconds", unfused}, {"stages", rows}};
}

int stages(const BenchArguments& o) {
    if (o.spp < 1) throw Error(ExitCode::usage, "--spp: at least 1 is needed");
    const LoadedScene loaded = load_scene(o.scene, {{"--json", o.json}});
    RenderSettings settings = o.render.settings(loaded.scene);
    settings.expected_samples = o.spp;
    if (o.unfused && settings.fuse == Fuse::none)
        throw Error(ExitCode::usage, "--unfused: with fuse=none no stage runs inside of another");
    std::unique_ptr<Renderer> renderer = make_renderer(loaded.scene, settings);
    RenderPosition position = render(o, *renderer);
    const RenderStats stats = renderer->stats();
    std::vector<FusedShare> shares;
    double unfused_seconds = 0;
    if (o.unfused && !position.interrupted) {
        renderer.reset();  // its memory is needed
        RenderSettings unfused = settings;
        unfused.fuse = Fuse::none;
        renderer = make_renderer(loaded.scene, unfused);
        position.interrupted = render(o, *renderer).interrupted;
        unfused_seconds = renderer->stats().render_seconds;
        shares = fused_shares(stats.stages, renderer->stats().stages);
    }
    if (!o.json.empty()) {
        nlohmann::json json = stats_json(loaded.scene, settings, stats, loaded.seconds);
        if (o.unfused) json["fused_shares"] = shares_json(shares, unfused_seconds);
        write_json(o.json, json);
    }
    if (o.json != "-") {
        const double all = double(stats.rays_extend) + double(stats.rays_occlude);
        std::cout << fmt::format("{} on {} ({}), {}x{}, {} spp, {}rays/s\n\n", o.scene.path, stats.device, stats.accel,
                                 loaded.scene.sensor.crop_width, loaded.scene.sensor.crop_height, position.samples,
                                 format_count(stats.render_seconds > 0 ? all / stats.render_seconds : 0))
                  << stage_table(stats);
        if (!shares.empty()) std::cout << shares_table(shares, stats.render_seconds, unfused_seconds);
    }
    return int(position.interrupted ? ExitCode::interrupted : ExitCode::done);
}

/// Images a second.
int frames(const BenchArguments& o) {
    if (o.frames < 1) throw Error(ExitCode::usage, "--frames: at least 1 is needed");
    const LoadedScene loaded = load_scene(o.scene, {{"--json", o.json}});
    RenderSettings settings = o.render.settings(loaded.scene);
    settings.expected_samples = 1;
    const std::unique_ptr<Renderer> renderer = make_renderer(loaded.scene, settings);
    const FrameTimes times = time_frames(*renderer, o.frames, save_when_interrupted());
    const RenderStats stats = renderer->stats();
    const double median = times.median(), late = times.late();
    report(o, {{"scene", o.scene.path},
               {"method", method_text(used_settings(settings, stats))},
               {"device", stats.device},
               {"size", {loaded.scene.sensor.crop_width, loaded.scene.sensor.crop_height}},
               {"frames", times.seconds.size()},
               {"median_seconds", median},
               {"percentile_95_seconds", late},
               {"frames_per_second", median > 0 ? 1.0 / median : 0.0},
               {"memory", setting_text(settings, "memory")},
               {"memory_bytes_predicted", stats.memory_bytes_predicted},
               {"memory_bytes_peak", stats.memory_bytes_peak}});
    return int(times.seconds.size() < o.frames ? ExitCode::interrupted : ExitCode::done);
}

}  // namespace

void add_bench(CLI::App& app, Run& run) {
    CLI::App& command = *app.add_subcommand("bench", "Throughput of one part alone");
    command.require_subcommand(1);

    auto r = std::make_shared<BenchArguments>();
    CLI::App& rays_command =
        *command.add_subcommand("rays", "Ray traversal: primary, bounced and shadow rays of a scene");
    r->scene.add_to(rays_command);
    rays_command
        .add_option("--backend", r->backend,
                    "auto, cpu, cpu-single (no packets), cuda, cuda-fast (build=fast), cuda-bvh2 (a binary BVH), "
                    "cuda-optix (OptiX), "
                    "cpu-cwbvh, cpu-fast or cpu-bvh2 (the structures of cuda on the CPU)")
        ->capture_default_str();
    rays_command.add_option("--repetitions", r->repetitions, "Timed runs of each batch; the median counts")
        ->capture_default_str();
    rays_command.add_flag("--opaque", r->opaque, "Take surfaces of partial opacity as opaque");
    rays_command.add_option("--json", r->json, "Write the result to a file, or - for standard output");
    rays_command.callback([r, &run] { run = [r] { return rays(*r); }; });

    auto q = std::make_shared<BenchArguments>();
    CLI::App& queues_command = *command.add_subcommand(
        "queues", "Queues: pushing, compaction, iteration, and sorting of a scene's first hits and rays");
    q->scene.add_to(queues_command);
    queues_command.add_option("--backend", q->backend, "auto, cpu or cuda")->capture_default_str();
    queues_command
        .add_option("--items", q->items, "Number of threads, and of sorted items; 0: the default of the backend")
        ->capture_default_str();
    queues_command.add_option("--repetitions", q->repetitions, "Timed runs of each operation; the median counts")
        ->capture_default_str();
    queues_command.add_option("--json", q->json, "Write the result to a file, or - for standard output");
    queues_command.callback([q, &run] { run = [q] { return queues(*q); }; });

    auto f = std::make_shared<BenchArguments>();
    CLI::App& frames_command = *command.add_subcommand(
        "frames", "Images per second: one sample of every pixel on a cleared film, until its image is on the host");
    f->scene.add_to(frames_command);
    f->render.add_to(frames_command, false);
    frames_command.add_option("--frames", f->frames, "Frames that are timed")->capture_default_str();
    frames_command.add_option("--json", f->json, "Write the result to a file, or - for standard output");
    frames_command.callback([f, &run] { run = [f] { return frames(*f); }; });

    auto s = std::make_shared<BenchArguments>();
    CLI::App& stages_command = *command.add_subcommand("stages", "Time and items of every stage of a render");
    s->scene.add_to(stages_command);
    s->render.add_to(stages_command, false);
    stages_command.add_option("--spp", s->spp, "Samples per pixel")->capture_default_str();
    stages_command.add_flag("--unfused", s->unfused,
                            "Render again with fuse=none, and split the time of each fused stage in proportion to the "
                            "times of its parts there (an estimate)");
    stages_command.add_option("--json", s->json, "Write the statistics to a file, or - for standard output");
    stages_command.callback([s, &run] { run = [s] { return stages(*s); }; });
}

}  // namespace ambilux
