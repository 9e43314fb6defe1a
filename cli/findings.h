// What the command render says of its largest samples (--outliers) and of its invalid values, each with a command that
// replays it.
#pragma once

#include "cli/commands.h"
#include "render/replay/outliers.h"

namespace ambilux {

/// A render that is done. Its film is of no use after a search for invalid values.
struct FinishedRender {
    const SceneOptions& options;
    const Scene& scene;
    RenderSettings used;  ///< used_settings, with the backend that rendered
    InvalidWatch& watch;
    const SampleWatch* samples = nullptr;  ///< with --outliers
};

/// Prints the `count` largest samples to standard output unless `quiet`, and the first invalid values of every stage as
/// warnings. Returns `outliers` and `invalid_values` for the statistics.
nlohmann::json report_findings(const FinishedRender& render, uint32_t count, bool quiet,
                               const volatile bool* interrupt);

}  // namespace ambilux
