#include "experiments/task_runner.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "backends/cuda_device.h"
#include "core/atomic_file.h"
#include "core/log.h"
#include "core/ranks.h"
#include "experiments/batches.h"
#include "experiments/peers/peer.h"
#include "film/png_io.h"
#include "session/load.h"
#include "session/machine.h"
#include "session/stats_sum.h"
#include "session/technique_files.h"

namespace ambilux {

namespace fs = std::filesystem;

namespace {

/// Batches are told as independent of each other.
bool has_batches(const RenderTask& task) {
    const PeerKind* const peer = find_peer_kind(task.run.renderer);
    return peer ? peer->independent_passes : task.settings.sampler == Sampler::independent;
}

}  // namespace

Work work_after(const ExperimentConfig& config, const LoadedEntry& scene, const RenderPosition& p) {
    const double samples = config.spp.empty() ? 0 : double(config.spp.back()) - double(p.samples),
                 seconds = config.seconds.empty() ? 0 : config.seconds.back() - p.seconds;
    return {std::max(0.0, samples) * double(scene.pixels()), std::max(0.0, seconds)};
}

TaskRunner::TaskRunner(const ExperimentParts& parts)
    : p_(parts), config_(parts.prepared.config),
      nvml_(parts.prepared.backends.contains("cuda") ? cuda_device_bus_id() : "") {}

RunMaker& TaskRunner::maker(const RunEntry& run) const {
    return run.renderer.empty() ? p_.own : static_cast<RunMaker&>(p_.peers);
}

bool TaskRunner::is_done(size_t scene, const RunEntry& run, uint64_t seed) const {
    const RenderTask task = task_of(scene, run, seed);
    return p_.folder.runs().count(task.prefix) == p_.checkpoints.size() && !fs::exists(task.state_path);
}

RenderTask TaskRunner::task_of(size_t index, const RunEntry& run, uint64_t seed) const {
    return make_task(index, p_.prepared.scenes[index], run, seed, p_.folder);
}

void TaskRunner::begin_again(const Disturbed& d) {
    RenderTask task = task_of(d.scene, config_.runs[d.run], d.seed);
    log_info(fmt::format("{} {} is made again: {}", task.scene.entry->name, task.name, d.why));
    task.state.notes["attempts"] = d.attempts;
    // The state comes first: a process that is killed now goes on with it, and another rank finds it.
    make_folders(p_.folder.file("state", task.scene, ""));
    write_state(task.state_path, task.state);
    forget(task);
    p_.work.plan(task.work, 1, work_after(config_, task.scene, {}));
}

bool TaskRunner::render(size_t index, const RunEntry& run, uint64_t seed) {
    try {
        return try_render(index, run, seed);
    } catch (const PeerRefusal& e) {
        const RenderTask task = task_of(index, run, seed);
        p_.peers.lose(task.scene, run, seed, e.what());
        forget(task);
        p_.work.end(task.work);
        p_.folder.remove_state(task.state_path);
        std::error_code ignored;
        fs::remove(p_.folder.file("stats", task.scene, task.name + ".json"), ignored);
        return true;
    }
}

/// One render through all of its checkpoints.
bool TaskRunner::try_render(size_t index, const RunEntry& run, uint64_t seed) {
    if (!run.renderer.empty() && !p_.peers.agrees(p_.prepared.scenes[index], run)) {
        p_.work.skip(work_kind(p_.prepared.scenes[index], &run));
        return true;
    }
    RenderTask task = task_of(index, run, seed);
    if (is_done(index, run, seed)) {
        p_.work.skip(task.work);
        return true;
    }
    restore(task);
    task.settings = settings_for(config_, task.scene, run, seed, p_.hooks);
    const std::unique_ptr<Renderer> renderer = maker(run).make(task.what(), task.total);
    if (task.state.moments.samples) load_devices(*renderer, task.state.devices, task.state_path);
    const bool cuda = p_.prepared.backends.contains("cuda");
    gpu_ = {};
    const LoadReading load = p_.hooks.load();
    const bool whole = pass_checkpoints(task, *renderer);
    nlohmann::json machine = load_json(load, p_.hooks.load());
    machine["gpu"] = gpu_.json();
    machine["clocks"] = describe_clocks("after", cuda);
    machine["host"] = host_name();
    task.state.notes["machine"].push_back(machine);
    if (!whole) {
        if (task.state.moments.samples && !run.techniques) write_state(task.state_path, task.state);
        return false;
    }
    p_.work.end(task.work);
    finish(task);
    if (run.techniques) {
        write_technique_images(p_.folder.file("techniques", task.scene, task.name), task.scene.scene, task.settings,
                               task.stated(), renderer->strategy_images());
        p_.folder.runs().add(task.state.notes["rows"].get<std::vector<std::string>>());
    }
    p_.folder.batches().add(task.state.notes["batches"].get<std::vector<std::string>>());
    if (!run.renderer.empty()) p_.peers.found_again(task.scene, run, seed);
    p_.folder.remove_state(task.state_path);
    return true;
}

/// Rows of a render that begins anew.
void TaskRunner::forget(const RenderTask& task) const {
    p_.folder.runs().remove(task.prefix);
    p_.folder.batches().remove(task.prefix);
}

/// What an earlier part saved.
void TaskRunner::restore(RenderTask& task) {
    RenderState& state = task.state;
    if (auto saved = read_state(task.state_path)) {
        state = std::move(*saved);
        if (state.notes.contains("stats")) task.total = restore_stats(state.notes["stats"]);
        for (const auto& line : state.notes["rows"]) p_.folder.runs().add(line.get<std::string>());
        if (task.run.techniques && state.notes["attempts"].empty())
            log_info(fmt::format("{} {}: starts over, because the sums of its single strategies are not saved",
                                 task.scene.entry->name, task.name));
    }
    if (task.run.techniques) write_state(task.state_path, state);
    // Rows whose state is lost are made anew.
    if (state.notes["rows"].empty()) forget(task);
    const auto& done = state.notes["done"];
    for (size_t k = 0; k < p_.checkpoints.size(); ++k)
        if (std::find(done.begin(), done.end(), k) == done.end()) task.pending.push_back(k);
}

/// Renders from checkpoint to checkpoint; false if interrupted.
bool TaskRunner::pass_checkpoints(RenderTask& task, Renderer& renderer) {
    RenderState& state = task.state;
    RenderPosition position{state.moments.samples, state.notes["seconds"].get<double>(), false};
    position.iteration_samples = renderer.iteration_samples();
    // Choosing is part of the method: its time counts.
    position.seconds += renderer.stats().selection.seconds;
    p_.work.begin(task.work, work_after(config_, task.scene, position));
    RenderStats counted = renderer.stats();
    while (!task.pending.empty()) {
        const Budget budget = next_budget(config_, task.pending, position);
        const RenderPosition before = position;
        const LoadReading load = p_.hooks.load();
        position = drive_showing(task, renderer, position, budget);
        const LoadReading after = p_.hooks.load();
        add_part(task.total, counted, renderer.stats());
        state.notes["seconds"] = position.seconds;
        // The film restarts at each checkpoint and with each batch, so that a resumed render adds the same numbers
        // in the same order as an uninterrupted one.
        if (position.samples > before.samples) {
            const FilmMoments film = renderer.film();
            if (!position.interrupted && has_batches(task))
                record_batch(task, film, position.seconds - before.seconds, other_cores(load, after));
            state.moments.add(film);
            state.devices = save_devices(renderer);
            renderer.clear_film();
        }
        counted = renderer.stats();  // a renderer may or may not restart its counters with its film
        state.notes["stats"] = save_stats(task.total);
        if (position.interrupted) return false;
        record_checkpoints(task, position, budget);
    }
    return true;
}

void TaskRunner::record_batch(RenderTask& task, const FilmMoments& film, double seconds, double others) const {
    nlohmann::json& lines = task.state.notes["batches"];
    BatchRow b = measure_batch(film, p_.references[task.scene_index].image, seconds);
    b.scene = task.scene.entry->name;
    b.run = task.run.name;
    b.seed = task.settings.seed;
    b.batch = lines.size();
    b.other_cores = others;
    lines.push_back(batch_line(b));
}

RenderPosition TaskRunner::drive_showing(const RenderTask& task, Renderer& renderer, const RenderPosition& from,
                                         const Budget& budget) {
    RenderPosition last = from;
    return drive(renderer, from, budget, p_.request.interrupt, [&](const RenderPosition& p) {
        p_.work.progress(task.work, double(p.samples - last.samples) * double(task.scene.pixels()),
                         p.seconds - last.seconds);
        last = p;
        if (nvml_.is_there()) gpu_.add(nvml_.read());
        p_.show(
            fmt::format("{} {} seed {}: {} spp", task.scene.entry->name, task.run.name, task.settings.seed, p.samples));
    });
}

/// Rows, state and images of the checkpoints that `budget` ended at.
void TaskRunner::record_checkpoints(RenderTask& task, const RenderPosition& position, const Budget& budget) {
    const bool ended_by_time = budget.seconds > 0 && (budget.samples == 0 || position.samples < budget.samples);
    const auto reached = [&](size_t k) {
        const Checkpoint& c = p_.checkpoints[k];
        return c.samples ? position.samples >= c.samples
                         : position.seconds >= c.seconds || (ended_by_time && c.seconds <= budget.seconds);
    };
    std::vector<std::string> lines;
    for (const size_t k : task.pending)
        if (reached(k)) {
            lines.push_back(result_line(row(task, k)));
            task.state.notes["rows"].push_back(lines.back());
            task.state.notes["done"].push_back(k);
            if (k + 1 == p_.checkpoints.size()) write_images(task);
        }
    std::erase_if(task.pending, reached);
    if (task.run.techniques) return;  // its rows wait until all of its files are there
    if (lines.empty()) return;
    write_state(task.state_path, task.state);
    for (const std::string& line : lines) p_.folder.runs().add(line);
}

ResultRow TaskRunner::row(const RenderTask& task, size_t k) const {
    ResultRow r;
    r.scene = task.scene.entry->name;
    r.run = task.run.name;
    r.seed = task.settings.seed;
    r.checkpoint = k;
    r.budget = p_.checkpoints[k].samples ? "spp" : "seconds";
    const MethodNames names = maker(task.run).names(task.what(), task.total);
    r.integrator = names.integrator;
    r.variant = names.variant;
    r.estimator = names.estimator;
    r.method = names.method;
    r.stated_bias = names.bias;
    r.backend = task.total.backend;
    r.spp = task.state.moments.samples;
    r.time = task.state.notes["seconds"].get<double>();
    r.metrics = compare_images(task.state.moments, p_.references[task.scene_index].image);
    r.rays = task.total.rays_extend + task.total.rays_occlude;
    r.invalid = task.total.invalid.total();
    r.device = task.total.device;
    r.host = host_name();
    return r;
}

/// At the last checkpoint of the list: where there are some in seconds, all images have had the same time.
void TaskRunner::write_images(const RenderTask& task) const {
    const Image image = mean_image(task.state.moments);
    write_exr(p_.folder.file("images", task.scene, task.name + ".exr"), image,
              maker(task.run).attributes(task.what(), task.stated()));
    write_png(p_.folder.file("images", task.scene, task.name + ".png"), image);
}

void TaskRunner::finish(const RenderTask& task) const {
    if (task.total.invalid.total())
        log_warning(fmt::format("{} {}: {} invalid values dropped", task.scene.entry->name, task.name,
                                task.total.invalid.total()));
    nlohmann::json json = maker(task.run).statistics(task.what(), task.stated());
    json["machine"] = task.state.notes["machine"];
    json["attempts"] = task.state.notes.value("attempts", nlohmann::json::array());
    write_file_atomic(p_.folder.file("stats", task.scene, task.name + ".json"),
                      json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace ambilux
