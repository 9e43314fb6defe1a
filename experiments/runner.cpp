#include "experiments/runner.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "core/atomic_file.h"
#include "core/log.h"
#include "core/progress.h"
#include "core/version.h"
#include "experiments/drive.h"
#include "experiments/machine.h"
#include "experiments/prepare.h"
#include "experiments/reference_store.h"
#include "experiments/results.h"
#include "experiments/state.h"
#include "experiments/statistics.h"
#include "experiments/stats_sum.h"
#include "experiments/technique_files.h"
#include "experiments/work_estimate.h"
#include "film/png_io.h"

namespace ambilux {
namespace {

namespace fs = std::filesystem;

/// The ground truth of a scene and what the manifest says of it.
struct SceneReference {
    ReferencePlace place;
    Reference image;
    nlohmann::json notes;
};

/// Keeps a second process out of the folder; the system releases it when this one ends, however it does.
class FolderLock {
public:
    explicit FolderLock(const std::string& folder)
        : fd_(::open((folder + "/.lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
        if (fd_ < 0) throw Error(ExitCode::device, "cannot write into the folder " + folder);
        if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
            ::close(fd_);
            throw Error(ExitCode::device,
                        "another experiment is writing into " + folder + ": wait for it or choose another folder");
        }
    }
    ~FolderLock() { ::close(fd_); }
    FolderLock(const FolderLock&) = delete;
    FolderLock& operator=(const FolderLock&) = delete;

private:
    int fd_;
};

class Experiment {
public:
    Experiment(const ExperimentRequest& request, const Hooks& hooks)
        : request_(request), hooks_(hooks), prepared_(prepare_experiment(request.config, request.reduced, hooks)),
          config_(prepared_.config), checkpoints_(config_.checkpoints()) {}

    ExitCode run() {
        open_folder();
        const FolderLock lock(request_.output);
        read_earlier();
        add_clocks(manifest_["resumed"].empty() ? "start" : "resumed");
        write_manifest(false);
        plan();
        Progress progress("experiment " + config_.name);
        progress_ = &progress;
        for (size_t i = 0; i < prepared_.scenes.size(); ++i)
            if (!make_scene_reference(i)) return stopped();
        write_manifest(false);
        for (const uint64_t seed : config_.seeds)
            for (size_t i = 0; i < prepared_.scenes.size(); ++i)
                for (const RunEntry& run : config_.runs)
                    if (!render(i, run, seed)) return stopped();
        std::error_code ignored;
        fs::remove_all(request_.output + "/state", ignored);
        add_clocks("end");
        write_manifest(true);
        return ExitCode::done;
    }

private:
    void add_clocks(const std::string& when) {
        manifest_["clocks"].push_back(describe_clocks(when, prepared_.backends.contains("cuda")));
    }

    ExitCode stopped() {
        add_clocks("interrupted");
        write_manifest(false);
        return ExitCode::interrupted;
    }

    std::string file(const std::string& folder, const LoadedEntry& scene, const std::string& name) const {
        return fmt::format("{}/{}/{}/{}", request_.output, folder, scene.entry->name, name);
    }

    void open_folder() {
        make_folders(request_.output);
        const std::string resolved = resolved_toml(config_), path = request_.output + "/config.resolved.toml";
        if (fs::exists(path)) {
            if (!request_.resume)
                throw Error(ExitCode::usage,
                            request_.output +
                                " holds an experiment already: continue it with --resume or choose another folder");
            check_same_experiment(request_.output, config_);
        } else {
            if (fs::exists(request_.output + "/runs.csv"))
                throw Error(ExitCode::usage,
                            request_.output + " holds a runs.csv of something else: choose another folder");
            write_file_atomic(path, resolved);
        }
        references_ = request_.references.empty() ? request_.output + "/references" : request_.references;
        make_folders(references_);
        for (const char* folder : {"images", "stats", "state"})
            for (const LoadedEntry& scene : prepared_.scenes) make_folders(file(folder, scene, ""));
    }

    /// Parts of files that a killed process left.
    void remove_temporary_files() const {
        std::vector<fs::path> found;
        std::error_code ignored;
        for (const auto& entry :
             fs::recursive_directory_iterator(request_.output, fs::directory_options::skip_permission_denied, ignored))
            if (entry.is_regular_file(ignored) && entry.path().filename().string().find(".tmp-") != std::string::npos)
                found.push_back(entry.path());
        for (const fs::path& path : found) fs::remove(path, ignored);
    }

    /// Scenes must be those of the earlier part; rows are what it finished.
    void read_earlier() {
        remove_temporary_files();
        const std::string path = request_.output + "/manifest.json";
        if (fs::exists(path)) {
            manifest_ = nlohmann::json::parse(read_file(path), nullptr, false);
            if (!manifest_.is_object()) throw input_error(path, 0, "is damaged: remove the folder and start again");
            for (const LoadedEntry& scene : prepared_.scenes)
                for (const auto& earlier : manifest_["scenes"])
                    if (earlier.value("name", "") == scene.entry->name &&
                        earlier.value("hash", "") != scene_hash(scene.scene))
                        throw input_error(scene.entry->path, 0,
                                          "has changed since the experiment began: choose another folder");
            manifest_["resumed"].push_back(utc_now());
        } else {
            manifest_ = {
                {"date", utc_now()}, {"resumed", nlohmann::json::array()}, {"clocks", nlohmann::json::array()}};
        }
        lines_ = read_results(request_.output + "/runs.csv");
        rewrite_results();
    }

    void rewrite_results() const {
        std::string text = std::string(kResultHeader) + "\n";
        for (const std::string& line : lines_) text += line + "\n";
        write_file_atomic(request_.output + "/runs.csv", text);
    }

    void write_manifest(bool finished) {
        manifest_["name"] = config_.name;
        manifest_["config"] = config_.file;
        manifest_["versions"] = {{"ambilux", version()}, {"git_revision", git_revision()}, {"compiler", compiler()}};
        manifest_["machine"] = describe_machine();
        manifest_["devices"] = prepared_.devices;
        manifest_["backends"] = prepared_.backends;
        manifest_["seeds"] = config_.seeds;
        manifest_["checkpoints"] = nlohmann::json::object();
        if (!config_.spp.empty()) manifest_["checkpoints"]["spp"] = config_.spp;
        if (!config_.seconds.empty()) manifest_["checkpoints"]["seconds"] = config_.seconds;
        manifest_["trimmed_share"] = kTrimmedShare;
        manifest_["ablation_default"] =
            config_.ablation_default.empty() ? nlohmann::json(nullptr) : nlohmann::json(config_.ablation_default);
        manifest_["finished"] = finished ? nlohmann::json(utc_now()) : nlohmann::json(nullptr);
        nlohmann::json scenes = nlohmann::json::array(), runs = nlohmann::json::array();
        for (size_t i = 0; i < prepared_.scenes.size(); ++i) {
            const LoadedEntry& s = prepared_.scenes[i];
            scenes.push_back({{"name", s.entry->name},
                              {"path", s.entry->path},
                              {"hash", scene_hash(s.scene)},
                              {"size", {s.scene.sensor.crop_width, s.scene.sensor.crop_height}},
                              {"max_depth", s.max_depth},
                              {"reference", references_made_[i].notes}});
        }
        for (const RunEntry& run : config_.runs) {
            nlohmann::json settings = nlohmann::json::object();
            for (const auto& [key, value] : run.settings) settings[key] = value;
            nlohmann::json entry = {{"name", run.name}, {"settings", settings}};
            if (!run.swept.empty()) {
                nlohmann::json swept = nlohmann::json::object();
                for (const auto& [key, value] : run.swept) swept[key] = value;
                entry["sweep"] = {{"of", run.base}, {"values", swept}};
            }
            if (run.techniques) entry["techniques"] = run.techniques;
            runs.push_back(entry);
        }
        manifest_["scenes"] = scenes;
        manifest_["runs"] = runs;
        write_file_atomic(request_.output + "/manifest.json",
                          manifest_.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    }

    static std::string kind(const LoadedEntry& scene, const RunEntry* run) {
        return scene.entry->name + "/" + (run ? run->name : "");
    }
    /// What is left of a render that stands at `p`.
    Work work_after(const LoadedEntry& scene, const RenderPosition& p) const {
        const double samples = config_.spp.empty() ? 0 : double(config_.spp.back()) - double(p.samples),
                     seconds = config_.seconds.empty() ? 0 : config_.seconds.back() - p.seconds;
        return {std::max(0.0, samples) * double(scene.pixels()), std::max(0.0, seconds)};
    }

    void plan() {
        for (size_t i = 0; i < prepared_.scenes.size(); ++i) {
            const LoadedEntry& scene = prepared_.scenes[i];
            ReferencePlace& place = references_made_[i].place;
            place = find_reference(references_, config_, *scene.entry, scene.scene, scene.max_depth, hooks_);
            const uint64_t wanted = scene.entry->reference.spp;
            if (place.cached < wanted)
                work_.plan(kind(scene, nullptr), 1, {double(wanted - place.cached) * double(scene.pixels()), 0});
            for (const RunEntry& run : config_.runs)
                work_.plan(kind(scene, &run), double(config_.seeds.size()), work_after(scene, {}));
        }
    }

    void show(const std::string& what) { progress_->update(work_.fraction(), what, work_.seconds_left()); }

    bool make_scene_reference(size_t index) {
        const LoadedEntry& scene = prepared_.scenes[index];
        SceneReference& made = references_made_[index];
        const std::string work = kind(scene, nullptr);
        // Looked for again: another scene of this experiment may have been the same.
        made.place = find_reference(references_, config_, *scene.entry, scene.scene, scene.max_depth, hooks_);
        const ReferenceLock lock(made.place.path, request_.interrupt);
        if (!lock.held()) return false;
        ReferenceRequest request;
        request.path = made.place.path;
        request.spp = scene.entry->reference.spp;
        request.settings = made.place.settings;
        request.settings_text = made.place.settings_text;
        request.checkpoint_seconds = request_.reference_checkpoint_seconds;
        request.interrupt = request_.interrupt;
        RenderPosition last;
        bool started = false;
        work_.begin(work, {double(request.spp - std::min(request.spp, made.place.cached)) * double(scene.pixels()), 0});
        request.on_batch = [&](const RenderPosition& p) {
            // The first call after a continued file has no predecessor: it counts little.
            if (started)
                work_.progress(work, double(p.samples - last.samples) * double(scene.pixels()),
                               p.seconds - last.seconds);
            started = true;
            last = p;
            show(fmt::format("reference of {}: {} of {} spp", scene.entry->name, p.samples, request.spp));
        };
        const ReferenceResult result = make_reference(scene.scene, request, hooks_);
        work_.end(work);
        if (result.interrupted) return false;
        made.image = result.reference;
        if (result.stats.invalid.total())
            log_warning(fmt::format("reference of {}: {} invalid values dropped", scene.entry->name,
                                    result.stats.invalid.total()));
        write_png(file("images", scene, "reference.png"), made.image.mean);
        double noise = 0;
        for (const float se : made.image.standard_error.rgb) noise += double(se) * double(se);
        const fs::path absolute = fs::absolute(made.place.path).lexically_normal();
        const fs::path inside = absolute.lexically_relative(fs::absolute(request_.output).lexically_normal());
        const bool is_inside = !inside.empty() && *inside.begin() != "..";
        made.notes = {{"file", (is_inside ? inside : absolute).string()},
                      {"spp", made.image.samples},
                      {"seed", config_.reference_seed},
                      {"integrator", made.place.settings.integrator},
                      {"settings", made.place.settings_text},
                      {"noise", std::sqrt(noise / double(made.image.standard_error.rgb.size()))},
                      {"seconds", result.attributes.value("seconds", 0.0)},
                      {"backend", result.attributes.value("backend", "")},
                      {"git_revision", result.attributes.value("git_revision", "")}};
        return true;
    }

    /// Appends a line unless the file has it.
    void add_line(const std::string& line) {
        if (std::find(lines_.begin(), lines_.end(), line) != lines_.end()) return;
        append_file(request_.output + "/runs.csv", line + "\n");
        lines_.push_back(line);
    }

    /// One render through all of its checkpoints; false if interrupted.
    bool render(size_t index, const RunEntry& run, uint64_t seed) {
        const LoadedEntry& scene = prepared_.scenes[index];
        const std::string name = fmt::format("{}_{}", run.name, seed),
                          state_path = file("state", scene, name + ".state");
        const std::string prefix = result_prefix(scene.entry->name, run.name, seed);
        const auto ours = [&](const std::string& line) { return line.starts_with(prefix); };
        const std::string work = kind(scene, &run);

        if (size_t(std::count_if(lines_.begin(), lines_.end(), ours)) == checkpoints_.size() &&
            !fs::exists(state_path)) {
            work_.skip(work);
            return true;
        }
        RenderState state;
        RenderStats total;
        state.notes = {{"seconds", 0.0}, {"done", nlohmann::json::array()}, {"rows", nlohmann::json::array()}};
        if (run.techniques) {
            if (fs::exists(state_path))
                log_info(fmt::format("{} {}: starts over, because the sums of its single strategies are not saved",
                                     scene.entry->name, name));
            write_file_atomic(state_path, "begun\n");
        } else if (auto saved = read_state(state_path)) {
            state = std::move(*saved);
            total = restore_stats(state.notes["stats"]);
            for (const auto& line : state.notes["rows"]) add_line(line.get<std::string>());
        }
        // Rows whose state is lost are made anew.
        if (state.notes["rows"].empty() && std::erase_if(lines_, ours) > 0) rewrite_results();

        const RenderSettings settings = settings_for(config_, scene, run, seed, hooks_);
        RenderSettings made = settings;
        if (settings.automatic && !total.choice.name.empty()) {
            // What the first part chose, even if this machine is another or busier.
            made.automatic = false;
            for (const auto& [key, value] : total.choice.settings) hooks_.apply_setting(made, key, value);
        }
        for (const Checkpoint& c : checkpoints_) {
            made.expected_samples = std::max(made.expected_samples, c.samples);
            made.expected_seconds = std::max(made.expected_seconds, c.seconds);
        }
        const std::unique_ptr<Renderer> renderer = hooks_.make_renderer(scene.scene, made);
        RenderPosition position{state.moments.samples, state.notes["seconds"].get<double>(), false};
        // Choosing is part of the method: its time counts.
        position.seconds += renderer->stats().choice.seconds;
        work_.begin(work, work_after(scene, position));
        std::vector<size_t> pending;
        for (size_t k = 0; k < checkpoints_.size(); ++k)
            if (std::find(state.notes["done"].begin(), state.notes["done"].end(), k) == state.notes["done"].end())
                pending.push_back(k);
        RenderStats counted = renderer->stats();
        while (!pending.empty()) {
            Budget budget;
            for (const size_t k : pending) {
                const Checkpoint& c = checkpoints_[k];
                if (c.samples) budget.samples = budget.samples ? std::min(budget.samples, c.samples) : c.samples;
                if (c.seconds > 0)
                    budget.seconds = budget.seconds > 0 ? std::min(budget.seconds, c.seconds) : c.seconds;
            }
            RenderPosition last = position;
            const uint64_t before = position.samples;
            position = drive(*renderer, position, budget, request_.interrupt, [&](const RenderPosition& p) {
                work_.progress(work, double(p.samples - last.samples) * double(scene.pixels()),
                               p.seconds - last.seconds);
                last = p;
                show(fmt::format("{} {} seed {}: {} spp", scene.entry->name, run.name, seed, p.samples));
            });
            add_part(total, counted, renderer->stats());
            state.notes["seconds"] = position.seconds;
            // The film restarts at each checkpoint, so that a resumed render adds the same numbers in the same order as
            // an uninterrupted one.
            if (position.samples > before) {
                state.moments.add(renderer->film());
                renderer->clear_film();
            }
            counted = renderer->stats();  // a renderer may or may not restart its counters with its film
            state.notes["stats"] = save_stats(total);
            if (position.interrupted) {
                if (state.moments.samples && !run.techniques) write_state(state_path, state);
                return false;
            }
            const bool ended_by_time = budget.seconds > 0 && (budget.samples == 0 || position.samples < budget.samples);
            const auto reached = [&](size_t k) {
                const Checkpoint& c = checkpoints_[k];
                return c.samples ? position.samples >= c.samples
                                 : position.seconds >= c.seconds || (ended_by_time && c.seconds <= budget.seconds);
            };
            std::vector<std::string> lines;
            for (const size_t k : pending)
                if (reached(k)) {
                    lines.push_back(result_line(row(index, run, settings, total, state, k)));
                    state.notes["rows"].push_back(lines.back());
                    state.notes["done"].push_back(k);
                    if (k + 1 == checkpoints_.size()) write_images(scene, name, settings, total, state);
                }
            std::erase_if(pending, reached);
            if (run.techniques) continue;  // its rows wait until all of its files are there
            write_state(state_path, state);
            for (const std::string& line : lines) add_line(line);
        }
        work_.end(work);
        finish(scene, name, settings, total, state);
        if (run.techniques) {
            write_technique_images(file("techniques", scene, name), scene.scene, settings, stated(total, state),
                                   renderer->strategy_images());
            for (const auto& line : state.notes["rows"]) add_line(line.get<std::string>());
        }
        std::error_code ignored;
        fs::remove(state_path, ignored);
        return true;
    }

    ResultRow row(size_t index, const RunEntry& run, const RenderSettings& settings, const RenderStats& total,
                  const RenderState& state, size_t k) const {
        ResultRow r;
        r.scene = prepared_.scenes[index].entry->name;
        r.run = run.name;
        r.seed = settings.seed;
        r.checkpoint = k;
        r.budget = checkpoints_[k].samples ? "spp" : "seconds";
        r.integrator = settings.integrator;
        r.variant = settings.variant;
        r.estimator = setting_text(settings, "estimator");
        r.backend = total.backend;
        r.spp = state.moments.samples;
        r.time = state.notes["seconds"].get<double>();
        r.metrics = compare_images(state.moments, references_made_[index].image);
        r.rays = total.rays_extend + total.rays_occlude;
        r.invalid = total.invalid.total();
        return r;
    }

    /// Totals over all parts of a resumed render.
    static RenderStats stated(RenderStats total, const RenderState& state) {
        total.samples = state.moments.samples;
        total.render_seconds = state.notes["seconds"].get<double>();
        return total;
    }

    /// The image at the last checkpoint of the list: where there are checkpoints in seconds, all images have had the
    /// same time.
    void write_images(const LoadedEntry& scene, const std::string& name, const RenderSettings& settings,
                      const RenderStats& total, const RenderState& state) {
        const Image image = mean_image(state.moments);
        write_exr(file("images", scene, name + ".exr"), image,
                  image_attributes(scene.scene, settings, stated(total, state)));
        write_png(file("images", scene, name + ".png"), image);
    }

    void finish(const LoadedEntry& scene, const std::string& name, const RenderSettings& settings,
                const RenderStats& total, const RenderState& state) {
        if (total.invalid.total())
            log_warning(
                fmt::format("{} {}: {} invalid values dropped", scene.entry->name, name, total.invalid.total()));
        const nlohmann::json json = stats_json(scene.scene, settings, stated(total, state), scene.load_seconds);
        write_file_atomic(file("stats", scene, name + ".json"),
                          json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    }

    const ExperimentRequest& request_;
    const Hooks& hooks_;
    const Prepared prepared_;
    const ExperimentConfig& config_;
    const std::vector<Checkpoint> checkpoints_;
    std::string references_;
    std::vector<SceneReference> references_made_ = std::vector<SceneReference>(prepared_.scenes.size());
    std::vector<std::string> lines_;  ///< of runs.csv
    nlohmann::json manifest_;
    WorkEstimate work_;
    Progress* progress_ = nullptr;
};

}  // namespace

void check_same_experiment(const std::string& folder, const ExperimentConfig& config) {
    const std::string path = folder + "/config.resolved.toml", earlier = read_file(path), now = resolved_toml(config);
    if (earlier == now) return;
    std::istringstream a(earlier), b(now);
    std::string line_a, line_b;
    for (int line = 1;; ++line) {
        const bool more_a = bool(std::getline(a, line_a)), more_b = bool(std::getline(b, line_b));
        if (!more_a) line_a = "(end)";
        if (!more_b) line_b = "(end)";
        if (line_a != line_b || (!more_a && !more_b))
            throw input_error(path, line,
                              fmt::format("the experiment in this folder has a different configuration: '{}' there, "
                                          "'{}' now. Choose another folder",
                                          line_a, line_b));
    }
}

ExitCode run_experiment(const ExperimentRequest& request, const Hooks& hooks) {
    return Experiment(request, hooks).run();
}

}  // namespace ambilux
