// What a render did, as JSON and as image attributes.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "film/exr_io.h"
#include "render/renderer.h"

namespace ambilux {

/// SHA-256 of the scene's content as 64 hexadecimal digits.
std::string scene_hash(const Scene& scene);

const char* estimator_name(Estimator estimator);
const char* heuristic_name(MisHeuristic heuristic);

/// The statistics of a render: scene, integrator, variant, estimator, backend, device, seed, size, spp, seconds {load,
/// build, render}, rays {extend, occlude}, stages, queues, invalid, memory_bytes, features, skipped, version and more.
nlohmann::json stats_json(const Scene& scene, const RenderSettings& settings, const RenderStats& stats,
                          double load_seconds);

/// What every image file says about its making.
Attributes image_attributes(const Scene& scene, const RenderSettings& settings, const RenderStats& stats);

/// The settings with which the choice of bdpt.auto runs again, as options; empty if nothing was chosen.
std::string choice_line(const SelectionStats& choice);

/// The stages as a table for a person: share of time, items, launches, time per item.
std::string stage_table(const RenderStats& stats);

}  // namespace ambilux
