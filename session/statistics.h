// What a render did, as JSON and as image attributes.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "film/exr_io.h"
#include "render/renderer.h"

namespace ambilux {

/// SHA-256 of the scene's content as 64 hexadecimal digits.
std::string scene_hash(const Scene& scene);

/// The settings that a render ran with: bdpt.auto replaces some of those asked for, the renderer those left open.
RenderSettings used_settings(const RenderSettings& asked, const RenderStats& stats);

/// What ran, in a line: integrator, variant, what the variant has of its own, and all that changes the estimator from
/// its default, such as "bdpt lvc connections=16 light_paths=0.25".
std::string method_text(const RenderSettings& used);

/// All settings by key (integrators/settings.cpp), and those of the variant's own.
nlohmann::json settings_json(const RenderSettings& settings);

/// What a start and a render took: load, device (driver and context), build, and of it structure and kernels; render.
nlohmann::json seconds_json(const RenderStats& stats, double load_seconds);

/// The statistics of a render: the settings as used and, under `asked`, as asked for; scene, backend, device, size,
/// spp, seconds (seconds_json), rays {extend, occlude}, stages, queues, invalid, memory_bytes, features, skipped,
/// version and more.
nlohmann::json stats_json(const Scene& scene, const RenderSettings& settings, const RenderStats& stats,
                          double load_seconds);

/// What every image file says about its making.
Attributes image_attributes(const Scene& scene, const RenderSettings& settings, const RenderStats& stats);

/// The settings with which the selection of bdpt.auto runs again, as options; empty if nothing was chosen.
std::string selection_line(const SelectionStats& selection);

/// The stages as a table for a person: share of time, items, launches, time per item.
std::string stage_table(const RenderStats& stats);

}  // namespace ambilux
