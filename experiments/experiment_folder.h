// The folder that an experiment writes into: its lock, the rows and manifest of all parts, and where files lie.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/file_lock.h"
#include "experiments/prepare.h"
#include "experiments/results.h"

namespace ambilux {

/// Keeps a second process out of the folder. Throws Error(device) if one is in it.
class FolderLock {
public:
    explicit FolderLock(const std::string& folder);

private:
    FileLock lock_;
};

class ExperimentFolder {
public:
    /// Makes the folder, or with `resume` continues one of the same configuration and scenes. `references`: where they
    /// are kept; empty: inside. Of several ranks the first one holds it; tables of the others tell it what they would
    /// write (experiments/task_dealer.h). Throws Error.
    ExperimentFolder(const std::string& path, const std::string& references, bool resume, const Prepared& prepared);

    const std::string& path() const { return path_; }
    const std::string& references() const { return references_; }
    std::string file(const std::string& folder, const LoadedEntry& scene, const std::string& name) const;
    void remove_states() const;
    /// Of a render that is complete, after its rows.
    void remove_state(const std::string& path) const;

    ResultTable& runs() { return *runs_; }
    ResultTable& batches() { return *batches_; }

    void add_clocks(const std::string& when);
    /// That an earlier part of the experiment wrote here.
    bool is_resumed() const { return !manifest_["resumed"].empty(); }
    /// What the manifest says of the reference of a scene.
    void describe_reference(size_t scene, const nlohmann::json& notes) { reference_notes_[scene] = notes; }
    /// Renders whose times are not to be trusted though they were repeated.
    void describe_disturbed(const nlohmann::json& list) { manifest_["disturbed"] = list; }
    /// What the manifest says of the processes and their devices, and which of these they share ("": none).
    void describe_ranks(const nlohmann::json& notes, const std::string& shared);
    void write_manifest(bool finished);

private:
    void open(bool resume) const;
    void remove_temporary_files() const;
    void read_manifest();
    nlohmann::json describe_scenes() const;
    nlohmann::json describe_runs() const;

    const std::string path_, references_;
    const Prepared& prepared_;
    const ExperimentConfig& config_;
    std::optional<FolderLock> lock_;
    std::optional<ResultTable> runs_, batches_;
    nlohmann::json manifest_;
    std::vector<nlohmann::json> reference_notes_;  ///< by scene
};

/// Throws Error(bad_input) that shows the first difference if the folder holds an experiment of another configuration.
void check_same_experiment(const std::string& folder, const ExperimentConfig& config);

}  // namespace ambilux
