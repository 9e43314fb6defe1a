// A folder of references, found by what they show: content of the scene, depth, size, and how they were made.
#pragma once

#include <string>

#include "core/file_lock.h"
#include "experiments/config.h"
#include "session/hooks.h"
#include "session/reference.h"

namespace ambilux {

/// What a reference is made of: where it lies, how it is rendered, and how a person would say that.
struct ReferencePlace {
    std::string path;
    RenderSettings settings;
    std::string settings_text;  ///< "" for the path tracer, else such as "integrator=bdpt variant=lvc"
    uint64_t cached = 0;        ///< samples that the file holds; 0 without a file
};

/// Settings of a scene's reference. Throws Error(bad_input) with file and line.
RenderSettings reference_settings(const ExperimentConfig& config, const SceneEntry& entry, const Scene& scene,
                                  int max_depth, const Hooks& hooks);

/// Where the reference of a scene lies in `folder`. A file of another name for the same scene content, depth, size,
/// seed and making is taken as well, so that experiments that share a folder need not agree on names. The folder may be
/// missing.
ReferencePlace find_reference(const std::string& folder, const ExperimentConfig& config, const SceneEntry& entry,
                              const Scene& scene, int max_depth, const Hooks& hooks);

/// Keeps other processes from making the reference at `path` at the same time; the system releases it when this one
/// ends, however it does.
class ReferenceLock {
public:
    /// Waits for another process. `held()` is false if *interrupt became true meanwhile.
    ReferenceLock(const std::string& path, const volatile bool* interrupt);
    bool held() const { return held_; }

private:
    FileLock lock_;
    bool held_ = false;
};

/// What a manifest says of a reference. `folder`: of the experiment; files inside it are named relative to it.
nlohmann::json describe_reference(const ReferencePlace& place, const Reference& image, const Attributes& attributes,
                                  const std::string& folder, uint64_t seed);

}  // namespace ambilux
