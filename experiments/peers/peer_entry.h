// Runs of peers in a configuration.
#pragma once

#include "experiments/config.h"
#include "experiments/toml_reader.h"

namespace ambilux {

/// That `run` names another renderer than this program. Throws Error(bad_input) if it is none that is known.
bool is_peer_run(const TomlReader& r, const toml::table& run);

/// Keys: name, renderer, integrator, variant, command and set with rr_depth, as the kind of peer has them. Throws
/// Error(bad_input) with file and line.
RunEntry read_peer_run(const TomlReader& r, const toml::table& run);

}  // namespace ambilux
