// Runs of a configuration: settings, sweeps, switches of an ablation.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "experiments/config.h"
#include "experiments/toml_reader.h"

namespace ambilux {

/// Adds integrator, variant, estimator and `set`, as runs and references have them.
void add_settings(const TomlReader& r, RunEntry& run, const toml::table& t);

/// The runs that one [[run]] stands for.
std::vector<RunEntry> read_run(const TomlReader& r, const toml::table& t, std::set<std::string>& names);

/// The default run and, after the runs, those that differ from it by one switch.
void read_ablation(const TomlReader& r, const toml::table& t, ExperimentConfig& config, std::set<std::string>& names);

}  // namespace ambilux
