// The saved state of one render of an experiment, from which it goes on with the next sample.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "film/moments.h"

namespace ambilux {

struct RenderState {
    FilmMoments moments;
    nlohmann::json notes;  ///< seconds, counters, finished rows
};

/// Writes sums in full (double) precision with a checksum. Atomic.
void write_state(const std::string& path, const RenderState& state);

/// Nothing if there is no such file or it is damaged: then the render begins anew, which is slow but right.
std::optional<RenderState> read_state(const std::string& path);

}  // namespace ambilux
