// The saved state of one render of an experiment, from which it goes on with the next sample.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "film/moments.h"

namespace ambilux {

class Renderer;

/// What each device keeps that renders (Renderer::save_state); an empty one has kept nothing yet. There are none where
/// a method keeps nothing, or what follows from the number of the iteration.
using DeviceStates = std::vector<std::vector<std::byte>>;

struct RenderState {
    FilmMoments moments;
    nlohmann::json notes;       ///< seconds, counters, finished rows
    DeviceStates devices = {};  ///< after the last of the samples
};

/// Of a renderer that is the only one of its render.
DeviceStates save_devices(Renderer& renderer);
/// Before its first sample. Throws as check_devices does.
void load_devices(Renderer& renderer, const DeviceStates& saved, const std::string& path);
/// Throws Error(bad_input) if other than `count` devices saved the state at `path`: what one has learned is no other's.
void check_devices(const DeviceStates& saved, size_t count, const std::string& path);

/// Writes sums in full (double) precision with a checksum. Atomic.
void write_state(const std::string& path, const RenderState& state);

/// Nothing if there is no such file or it is damaged: then the render begins anew, which is slow but right.
std::optional<RenderState> read_state(const std::string& path);

}  // namespace ambilux
