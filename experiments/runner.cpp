#include "experiments/runner.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>

#include "core/atomic_file.h"
#include "core/log.h"
#include "core/progress.h"
#include "core/version.h"
#include "experiments/config.h"
#include "experiments/drive.h"
#include "experiments/machine.h"
#include "experiments/reference.h"
#include "experiments/results.h"
#include "experiments/state.h"
#include "experiments/statistics.h"
#include "film/png_io.h"

namespace ambilux {
namespace {

namespace fs = std::filesystem;

struct LoadedEntry {
    const SceneEntry* entry = nullptr;
    Scene scene;
    double load_seconds = 0;
    int max_depth = -1;
    uint64_t reference_spp = 0;
    std::string reference_path;
    Reference reference;
    nlohmann::json reference_notes;
    uint64_t pixels() const { return uint64_t(scene.sensor.crop_width) * scene.sensor.crop_height; }
};

/// How much is left, from what each kind of work has cost so far.
class WorkEstimate {
public:
    void plan(const std::string& kind, double units) { left_[kind] += units; }
    void done(const std::string& kind, double units, double seconds) {
        left_[kind] = std::max(0.0, left_[kind] - units);
        for (Cost* cost : {&cost_[kind], &all_}) {
            cost->units += units;
            cost->seconds += seconds;
        }
    }
    /// Work that need not be done.
    void skip(const std::string& kind, double units) { left_[kind] = std::max(0.0, left_[kind] - units); }
    double seconds_done() const { return all_.seconds; }
    double seconds_left() const {
        double seconds = 0;
        for (const auto& [kind, units] : left_) {
            const auto own = cost_.find(kind);
            const Cost& cost = own != cost_.end() && own->second.units > 0 ? own->second : all_;
            if (units > 0) seconds += cost.units > 0 ? units * cost.seconds / cost.units : INFINITY;
        }
        return seconds;
    }
    double fraction() const {
        const double left = seconds_left();
        return std::isinf(left) ? 0 : left <= 0 ? 1 : seconds_done() / (seconds_done() + left);
    }

private:
    struct Cost {
        double units = 0, seconds = 0;
    };
    std::map<std::string, double> left_;
    std::map<std::string, Cost> cost_;
    Cost all_;
};

/// Keeps a second process out of the folder; the system releases it when this one ends, however it does.
class FolderLock {
public:
    explicit FolderLock(const std::string& folder) : fd_(::open((folder + "/.lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
        if (fd_ < 0) throw Error(ExitCode::device, "cannot write into the folder " + folder);
        if (::flock(fd_, LOCK_EX | LOCK_NB) != 0) {
            ::close(fd_);
            throw Error(ExitCode::device, "another experiment is writing into " + folder + ": wait for it or choose another folder");
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
    Experiment(const ExperimentRequest& request, const Hooks& hooks) : request_(request), hooks_(hooks), config_(read_experiment(request.config)) {}

    ExitCode run() {
        load_scenes();
        try_runs();
        open_folder();
        const FolderLock lock(request_.output);
        read_earlier();
        write_manifest(false);
        plan();
        Progress progress("experiment " + config_.name);
        progress_ = &progress;
        for (LoadedEntry& scene : scenes_)
            if (!make_scene_reference(scene)) return ExitCode::interrupted;
        write_manifest(false);
        for (const uint64_t seed : config_.seeds)
            for (const LoadedEntry& scene : scenes_)
                for (const RunEntry& run : config_.runs)
                    if (!render(scene, run, seed)) return ExitCode::interrupted;
        std::error_code ignored;
        fs::remove_all(request_.output + "/state", ignored);
        write_manifest(true);
        return ExitCode::done;
    }

private:
    RenderSettings settings_for(const LoadedEntry& scene, const RunEntry& run, uint64_t seed) const {
        RenderSettings s;
        s.backend = config_.backend;
        s.max_depth = scene.max_depth;
        s.rr_depth = scene.scene.integrator.rr_depth;
        for (size_t i = 0; i < run.settings.size(); ++i) try {
                hooks_.apply_setting(s, run.settings[i].first, run.settings[i].second);
            } catch (const Error& e) {
                throw input_error(config_.file, run.lines[i], fmt::format("run '{}': {}", run.name, e.what()));
            }
        s.seed = seed;
        return s;
    }

    void load_scenes() {
        for (const SceneEntry& entry : config_.scenes) try {
                LoadOptions options;
                options.width = entry.width;
                options.height = entry.height;
                options.lenient = entry.lenient;
                options.parameters = entry.parameters;
                const auto start = std::chrono::steady_clock::now();
                LoadedEntry loaded;
                loaded.entry = &entry;
                loaded.scene = hooks_.load_scene(entry.path, options);
                loaded.load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
                RenderSettings probe;
                loaded.max_depth = entry.max_depth.value_or(loaded.scene.integrator.max_depth);
                hooks_.apply_setting(probe, "max_depth", std::to_string(loaded.max_depth));
                loaded.reference_spp = entry.reference_spp.value_or(config_.reference_spp);
                for (const std::string& warning : loaded.scene.warnings) log_warning(fmt::format("scene '{}': {}", entry.name, warning));
                scenes_.push_back(std::move(loaded));
            } catch (const Error& e) {
                if (e.code == ExitCode::device) throw;
                throw input_error(config_.file, entry.line, fmt::format("scene '{}': {}", entry.name, e.what()));
            }
    }

    /// Every run must be accepted by the renderer before hours of work begin; the first scene stands for all.
    void try_runs() {
        for (const RunEntry& run : config_.runs) {
            for (const LoadedEntry& scene : scenes_) settings_for(scene, run, 0);
            try {
                const RenderStats stats = hooks_.make_renderer(scenes_[0].scene, settings_for(scenes_[0], run, 0))->stats();
                devices_.insert(stats.device);
                backends_.insert(stats.backend);
            } catch (const Error& e) {
                if (e.code != ExitCode::usage) throw;
                throw input_error(config_.file, run.line, fmt::format("run '{}': {}", run.name, e.what()));
            }
        }
    }

    std::string file(const std::string& folder, const LoadedEntry& scene, const std::string& name) const {
        return fmt::format("{}/{}/{}/{}", request_.output, folder, scene.entry->name, name);
    }

    void open_folder() {
        make_folders(request_.output);
        const std::string resolved = resolved_toml(config_), path = request_.output + "/config.resolved.toml";
        if (fs::exists(path)) {
            const std::string earlier = read_file(path);
            if (!request_.resume)
                throw Error(ExitCode::usage, request_.output + " holds an experiment already: continue it with --resume or choose another folder");
            if (earlier != resolved) throw Error(ExitCode::bad_input, difference(path, earlier, resolved));
        } else {
            if (fs::exists(request_.output + "/runs.csv"))
                throw Error(ExitCode::usage, request_.output + " holds a runs.csv of something else: choose another folder");
            write_file_atomic(path, resolved);
        }
        references_ = request_.references.empty() ? request_.output + "/references" : request_.references;
        make_folders(references_);
        for (const char* folder : {"images", "stats", "state"})
            for (const LoadedEntry& scene : scenes_) make_folders(file(folder, scene, ""));
    }

    static std::string difference(const std::string& path, const std::string& earlier, const std::string& now) {
        std::istringstream a(earlier), b(now);
        std::string line_a, line_b;
        for (int line = 1;; ++line) {
            const bool more_a = bool(std::getline(a, line_a)), more_b = bool(std::getline(b, line_b));
            if (!more_a) line_a = "(end)";
            if (!more_b) line_b = "(end)";
            if (line_a != line_b || (!more_a && !more_b))
                return fmt::format("{}:{}: the experiment in this folder has a different configuration: '{}' there, '{}' now. Choose another folder", path,
                                   line, line_a, line_b);
        }
    }

    /// Scenes must be those of the earlier part; rows are what it finished.
    void read_earlier() {
        const std::string path = request_.output + "/manifest.json";
        if (fs::exists(path)) {
            manifest_ = nlohmann::json::parse(read_file(path), nullptr, false);
            if (!manifest_.is_object()) throw input_error(path, 0, "is damaged: remove the folder and start again");
            for (const LoadedEntry& scene : scenes_)
                for (const auto& earlier : manifest_["scenes"])
                    if (earlier.value("name", "") == scene.entry->name && earlier.value("hash", "") != scene_hash(scene.scene))
                        throw input_error(scene.entry->path, 0, "has changed since the experiment began: choose another folder");
            manifest_["resumed"].push_back(utc_now());
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
        if (manifest_.is_null()) manifest_ = {{"date", utc_now()}, {"resumed", nlohmann::json::array()}};
        manifest_["name"] = config_.name;
        manifest_["config"] = config_.file;
        manifest_["versions"] = {{"ambilux", version()}, {"git_revision", git_revision()}, {"compiler", compiler()}};
        manifest_["machine"] = describe_machine();
        manifest_["devices"] = devices_;
        manifest_["backends"] = backends_;
        manifest_["seeds"] = config_.seeds;
        manifest_["checkpoints"] = config_.spp.empty() ? nlohmann::json{{"seconds", config_.seconds}} : nlohmann::json{{"spp", config_.spp}};
        manifest_["finished"] = finished ? nlohmann::json(utc_now()) : nlohmann::json(nullptr);
        nlohmann::json scenes = nlohmann::json::array(), runs = nlohmann::json::array();
        for (const LoadedEntry& s : scenes_)
            scenes.push_back({{"name", s.entry->name},
                              {"path", s.entry->path},
                              {"hash", scene_hash(s.scene)},
                              {"size", {s.scene.sensor.crop_width, s.scene.sensor.crop_height}},
                              {"max_depth", s.max_depth},
                              {"reference", s.reference_notes}});
        for (const RunEntry& run : config_.runs) {
            nlohmann::json settings = nlohmann::json::object();
            for (const auto& [key, value] : run.settings) settings[key] = value;
            runs.push_back({{"name", run.name}, {"settings", settings}});
        }
        manifest_["scenes"] = scenes;
        manifest_["runs"] = runs;
        write_file_atomic(request_.output + "/manifest.json", manifest_.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    }

    // Units of work: samples of all pixels, or seconds where those are given.
    double units(const LoadedEntry& scene, const RenderPosition& p) const { return config_.spp.empty() ? p.seconds : double(p.samples) * double(scene.pixels()); }
    static std::string kind(const LoadedEntry& scene, const RunEntry* run) { return scene.entry->name + "/" + (run ? run->name : ""); }

    void plan() {
        const RenderPosition all{config_.spp.empty() ? 0 : config_.spp.back(), config_.spp.empty() ? config_.seconds.back() : 0, false};
        for (const LoadedEntry& scene : scenes_) {
            work_.plan(kind(scene, nullptr), double(scene.reference_spp) * double(scene.pixels()));
            for (const RunEntry& run : config_.runs) work_.plan(kind(scene, &run), units(scene, all) * double(config_.seeds.size()));
        }
    }

    void show(const std::string& what) { progress_->update(work_.fraction(), what, work_.seconds_left()); }

    bool make_scene_reference(LoadedEntry& scene) {
        const std::string depth = scene.max_depth < 0 ? "inf" : std::to_string(scene.max_depth);
        const std::string seed = config_.reference_seed ? fmt::format("-s{}", config_.reference_seed) : "";
        scene.reference_path = fmt::format("{}/{}-{}-d{}-{}x{}{}.exr", references_, scene.entry->name, scene_hash(scene.scene).substr(0, 12), depth,
                                           scene.scene.sensor.crop_width, scene.scene.sensor.crop_height, seed);
        ReferenceRequest request;
        request.path = scene.reference_path;
        request.spp = scene.reference_spp;
        request.settings.backend = config_.backend;
        request.settings.max_depth = scene.max_depth;
        request.settings.rr_depth = scene.scene.integrator.rr_depth;
        request.settings.seed = config_.reference_seed;
        request.interrupt = request_.interrupt;
        RenderPosition last;
        bool started = false;
        request.on_batch = [&](const RenderPosition& p) {
            // The first call after a continued file has no predecessor: only its time counts.
            if (started) work_.done(kind(scene, nullptr), double(p.samples - last.samples) * double(scene.pixels()), p.seconds - last.seconds);
            started = true;
            last = p;
            show(fmt::format("reference of {}: {} of {} spp", scene.entry->name, p.samples, scene.reference_spp));
        };
        const ReferenceResult result = make_reference(scene.scene, request, hooks_);
        work_.skip(kind(scene, nullptr), INFINITY);
        if (result.interrupted) return false;
        scene.reference = result.reference;
        if (result.stats.invalid.total()) log_warning(fmt::format("reference of {}: {} invalid values dropped", scene.entry->name, result.stats.invalid.total()));
        write_png(file("images", scene, "reference.png"), scene.reference.mean);
        double noise = 0;
        for (const float se : scene.reference.standard_error.rgb) noise += double(se) * double(se);
        const fs::path absolute = fs::absolute(scene.reference_path).lexically_normal();
        const fs::path inside = absolute.lexically_relative(fs::absolute(request_.output).lexically_normal());
        const bool is_inside = !inside.empty() && *inside.begin() != "..";
        scene.reference_notes = {{"file", (is_inside ? inside : absolute).string()},
                                 {"spp", scene.reference.samples},
                                 {"seed", config_.reference_seed},
                                 {"noise", std::sqrt(noise / double(scene.reference.standard_error.rgb.size()))},
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
    bool render(const LoadedEntry& scene, const RunEntry& run, uint64_t seed) {
        const std::string name = fmt::format("{}_{}", run.name, seed), state_path = file("state", scene, name + ".state");
        const std::string prefix = result_prefix(scene.entry->name, run.name, seed);
        const auto ours = [&](const std::string& line) { return line.starts_with(prefix); };
        const std::string work = kind(scene, &run);
        const RenderPosition all{config_.spp.empty() ? 0 : config_.spp.back(), config_.spp.empty() ? config_.seconds.back() : 0, false};

        RenderState state;
        state.notes = {{"seconds", 0.0}, {"rays_extend", 0}, {"rays_occlude", 0}, {"nan", 0}, {"inf", 0}, {"negative", 0}, {"rows", nlohmann::json::array()}};
        if (auto saved = read_state(state_path)) {
            state = std::move(*saved);
            for (const auto& line : state.notes["rows"]) add_line(line.get<std::string>());
        } else if (size_t(std::count_if(lines_.begin(), lines_.end(), ours)) == config_.checkpoints()) {
            work_.skip(work, units(scene, all));
            return true;
        } else if (std::erase_if(lines_, ours) > 0) {
            rewrite_results();  // rows whose state is lost
        }

        const RenderSettings settings = settings_for(scene, run, seed);
        const std::unique_ptr<Renderer> renderer = hooks_.make_renderer(scene.scene, settings);
        RenderPosition position{state.moments.samples, state.notes["seconds"].get<double>(), false};
        work_.skip(work, units(scene, position));
        const uint64_t continued_from = state.moments.samples;
        RenderStats stats = renderer->stats(), counted = stats;
        for (size_t k = state.notes["rows"].size(); k < config_.checkpoints(); ++k) {
            const Budget budget = config_.spp.empty() ? Budget{0, config_.seconds[k]} : Budget{config_.spp[k], 0};
            RenderPosition last = position;
            const uint64_t before = position.samples;
            position = drive(*renderer, position, budget, request_.interrupt, [&](const RenderPosition& p) {
                work_.done(work, units(scene, p) - units(scene, last), p.seconds - last.seconds);
                last = p;
                show(fmt::format("{} {} seed {}: {} spp", scene.entry->name, run.name, seed, p.samples));
            });
            stats = renderer->stats();
            const auto count = [&](const char* key, uint64_t now, uint64_t before_batch) { state.notes[key] = state.notes[key].get<uint64_t>() + now - before_batch; };
            count("rays_extend", stats.rays_extend, counted.rays_extend);
            count("rays_occlude", stats.rays_occlude, counted.rays_occlude);
            count("nan", stats.invalid.nan, counted.invalid.nan);
            count("inf", stats.invalid.inf, counted.invalid.inf);
            count("negative", stats.invalid.negative, counted.invalid.negative);
            state.notes["seconds"] = position.seconds;
            // The film restarts at each checkpoint, so that a resumed render adds the same numbers in the same order as an uninterrupted one.
            if (position.samples > before) {
                state.moments.add(renderer->film());
                renderer->clear_film();
            }
            counted = renderer->stats();  // a renderer may or may not restart its counters with its film
            if (position.interrupted) {
                if (state.moments.samples) write_state(state_path, state);
                return false;
            }
            const std::string line = result_line(row(scene, run, settings, stats, state, k));
            state.notes["rows"].push_back(line);
            write_state(state_path, state);
            add_line(line);
        }
        finish(scene, name, settings, stats, state, continued_from);
        std::error_code ignored;
        fs::remove(state_path, ignored);
        return true;
    }

    ResultRow row(const LoadedEntry& scene, const RunEntry& run, const RenderSettings& settings, const RenderStats& stats, const RenderState& state, size_t k) const {
        const nlohmann::json& n = state.notes;
        ResultRow r;
        r.scene = scene.entry->name;
        r.run = run.name;
        r.seed = settings.seed;
        r.checkpoint = k;
        r.integrator = settings.integrator;
        r.variant = settings.variant;
        r.estimator = estimator_name(settings.estimator);
        r.backend = stats.backend;
        r.spp = state.moments.samples;
        r.time = n["seconds"].get<double>();
        r.metrics = compare_images(state.moments, scene.reference);
        r.rays = n["rays_extend"].get<uint64_t>() + n["rays_occlude"].get<uint64_t>();
        r.invalid = n["nan"].get<uint64_t>() + n["inf"].get<uint64_t>() + n["negative"].get<uint64_t>();
        return r;
    }

    void finish(const LoadedEntry& scene, const std::string& name, const RenderSettings& settings, RenderStats stats, const RenderState& state,
                uint64_t continued_from) {
        const nlohmann::json& n = state.notes;
        // Totals over all parts of a resumed render; the stages are those of the last part.
        stats.samples = state.moments.samples;
        stats.render_seconds = n["seconds"].get<double>();
        stats.rays_extend = n["rays_extend"].get<uint64_t>();
        stats.rays_occlude = n["rays_occlude"].get<uint64_t>();
        stats.invalid = {n["nan"].get<uint64_t>(), n["inf"].get<uint64_t>(), n["negative"].get<uint64_t>()};
        if (stats.invalid.total()) log_warning(fmt::format("{} {}: {} invalid values dropped", scene.entry->name, name, stats.invalid.total()));
        const Image image = mean_image(state.moments);
        write_exr(file("images", scene, name + ".exr"), image, image_attributes(scene.scene, settings, stats));
        write_png(file("images", scene, name + ".png"), image);
        nlohmann::json json = stats_json(scene.scene, settings, stats, scene.load_seconds);
        json["stages_since_spp"] = continued_from;
        write_file_atomic(file("stats", scene, name + ".json"), json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    }

    const ExperimentRequest& request_;
    const Hooks& hooks_;
    const ExperimentConfig config_;
    std::string references_;
    std::vector<LoadedEntry> scenes_;
    std::set<std::string> devices_, backends_;
    std::vector<std::string> lines_;  ///< of runs.csv
    nlohmann::json manifest_;
    WorkEstimate work_;
    Progress* progress_ = nullptr;
};

}  // namespace

ExitCode run_experiment(const ExperimentRequest& request, const Hooks& hooks) { return Experiment(request, hooks).run(); }

}  // namespace ambilux
