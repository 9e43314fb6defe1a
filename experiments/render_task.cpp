#include "experiments/render_task.h"

#include <fmt/format.h>

namespace ambilux {

RenderTask make_task(size_t index, const LoadedEntry& scene, const RunEntry& run, uint64_t seed,
                     const ExperimentFolder& folder) {
    const std::string name = fmt::format("{}_{}", run.name, seed);
    RenderTask task{index,
                    scene,
                    run,
                    {},
                    name,
                    work_kind(scene, &run),
                    result_prefix(scene.entry->name, run.name, seed),
                    folder.file("state", scene, name + ".state"),
                    {},
                    {},
                    {}};
    task.state.notes = {{"seconds", 0.0}};
    for (const char* list : {"done", "rows", "batches", "attempts"}) task.state.notes[list] = nlohmann::json::array();
    return task;
}

std::string work_kind(const LoadedEntry& scene, const RunEntry* run) {
    return scene.entry->name + "/" + (run ? run->name : "");
}

}  // namespace ambilux
