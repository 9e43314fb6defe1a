#include "experiments/experiment_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/ranks.h"
#include "experiments/task_dealer.h"
#include "film/metrics.h"
#include "session/machine.h"
#include "session/statistics.h"

namespace ambilux {

namespace fs = std::filesystem;

namespace {
/// Of a folder; the analysis refuses those that it does not know.
constexpr int kFormat = 2;
}  // namespace

FolderLock::FolderLock(const std::string& folder) : lock_(folder + "/.lock") {
    if (!lock_.try_lock())
        throw Error(ExitCode::device,
                    "another experiment is writing into " + folder + ": wait for it or choose another folder");
}

ExperimentFolder::ExperimentFolder(const std::string& path, const std::string& references, bool resume,
                                   const Prepared& prepared)
    : path_(path), references_(references.empty() ? path + "/references" : references), prepared_(prepared),
      config_(prepared.config), reference_notes_(prepared.scenes.size()) {
    if (ranks().rank() > 0) {
        runs_.emplace(tell_first_rank("runs"));
        batches_.emplace(tell_first_rank("batches"));
        return;
    }
    open(resume);
    lock_.emplace(path_);
    remove_temporary_files();
    read_manifest();
    runs_.emplace(path_ + "/runs.csv", kResultHeader);
    batches_.emplace(path_ + "/batches.csv", kBatchHeader);
}

void ExperimentFolder::open(bool resume) const {
    make_folders(path_);
    const std::string resolved = resolved_toml(config_), resolved_path = path_ + "/config.resolved.toml";
    if (fs::exists(resolved_path)) {
        if (!resume)
            throw Error(ExitCode::usage,
                        path_ + " holds an experiment already: continue it with --resume or choose another folder");
        check_same_experiment(path_, config_);
    } else {
        if (fs::exists(path_ + "/runs.csv"))
            throw Error(ExitCode::usage, path_ + " holds a runs.csv of something else: choose another folder");
        write_file_atomic(resolved_path, resolved);
    }
    make_folders(references_);
    for (const char* folder : {"images", "stats", "state"})
        for (const LoadedEntry& scene : prepared_.scenes) make_folders(file(folder, scene, ""));
}

std::string ExperimentFolder::file(const std::string& folder, const LoadedEntry& scene, const std::string& name) const {
    return fmt::format("{}/{}/{}/{}", path_, folder, scene.entry->name, name);
}

void ExperimentFolder::remove_states() const {
    std::error_code ignored;
    fs::remove_all(path_ + "/state", ignored);
}

void ExperimentFolder::remove_state(const std::string& path) const {
    if (ranks().rank() > 0) return tell_first_rank("states")("remove", {path});
    std::error_code ignored;
    fs::remove(path, ignored);
}

/// Parts of files that a killed process left.
void ExperimentFolder::remove_temporary_files() const {
    std::vector<fs::path> found;
    std::error_code ignored;
    for (const auto& entry :
         fs::recursive_directory_iterator(path_, fs::directory_options::skip_permission_denied, ignored))
        if (entry.is_regular_file(ignored) && entry.path().filename().string().find(".tmp-") != std::string::npos)
            found.push_back(entry.path());
    for (const fs::path& temporary : found) fs::remove(temporary, ignored);
}

/// Scenes must be those of the earlier part.
void ExperimentFolder::read_manifest() {
    const std::string path = path_ + "/manifest.json";
    if (!fs::exists(path)) {
        manifest_ = {{"date", utc_now()},
                     {"resumed", nlohmann::json::array()},
                     {"clocks", nlohmann::json::array()},
                     {"commands", {command_line()}}};
        return;
    }
    manifest_ = nlohmann::json::parse(read_file(path), nullptr, false);
    if (!manifest_.is_object()) throw input_error(path, 0, "is damaged: remove the folder and start again");
    for (const LoadedEntry& scene : prepared_.scenes)
        for (const auto& earlier : manifest_["scenes"])
            if (earlier.value("name", "") == scene.entry->name && earlier.value("hash", "") != scene_hash(scene.scene))
                throw input_error(scene.entry->path, 0,
                                  "has changed since the experiment began: choose another folder");
    manifest_["resumed"].push_back(utc_now());
    manifest_["commands"].push_back(command_line());
}

void ExperimentFolder::add_clocks(const std::string& when) {
    manifest_["clocks"].push_back(describe_clocks(when, prepared_.backends.contains("cuda")));
}

void ExperimentFolder::describe_ranks(const nlohmann::json& notes, const std::string& shared) {
    manifest_["ranks"] = notes;
    // Of an earlier part it stays true.
    if (!shared.empty()) manifest_["ranks_share"] = shared;
}

nlohmann::json ExperimentFolder::describe_scenes() const {
    nlohmann::json scenes = nlohmann::json::array();
    for (size_t i = 0; i < prepared_.scenes.size(); ++i) {
        const LoadedEntry& s = prepared_.scenes[i];
        scenes.push_back({{"name", s.entry->name},
                          {"path", s.entry->path},
                          {"hash", scene_hash(s.scene)},
                          {"size", {s.scene.sensor.crop_width, s.scene.sensor.crop_height}},
                          {"max_depth", s.max_depth},
                          {"reference", reference_notes_[i]}});
    }
    return scenes;
}

nlohmann::json ExperimentFolder::describe_runs() const {
    nlohmann::json runs = nlohmann::json::array();
    for (const RunEntry& run : config_.runs) {
        nlohmann::json settings = nlohmann::json::object();
        for (const auto& [key, value] : run.settings) settings[key] = value;
        nlohmann::json entry = {{"name", run.name}, {"settings", settings}};
        if (!run.renderer.empty()) entry["renderer"] = run.renderer;
        if (!run.swept.empty()) {
            nlohmann::json swept = nlohmann::json::object();
            for (const auto& [key, value] : run.swept) swept[key] = value;
            entry["sweep"] = {{"of", run.base}, {"values", swept}};
        }
        if (run.techniques) entry["techniques"] = run.techniques;
        runs.push_back(entry);
    }
    return runs;
}

void ExperimentFolder::write_manifest(bool finished) {
    manifest_["format"] = kFormat;
    manifest_["name"] = config_.name;
    manifest_["config"] = config_.file;
    manifest_["versions"] = describe_versions();
    manifest_["order"] = config_.random_order ? "random" : "listed";
    manifest_["repeats"] = config_.repeats;
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
    manifest_["scenes"] = describe_scenes();
    manifest_["runs"] = describe_runs();
    write_file_atomic(path_ + "/manifest.json",
                      manifest_.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

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

}  // namespace ambilux
