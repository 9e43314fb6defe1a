// Renders whose time is not to be trusted, since the machine was not theirs alone.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "experiments/experiment_folder.h"

namespace ambilux {

/// Share of the cores that others may hold during a render; time per sample over the least of the same method's.
constexpr double kBusyShare = 0.1, kSlowSample = 1.15;
/// Shorter renders are not judged: their load is noise.
constexpr double kShortestJudged = 0.2;

/// A render that was disturbed.
struct Disturbed {
    size_t scene = 0, run = 0;  ///< places in the configuration
    uint64_t seed = 0;
    std::string why;
    nlohmann::json attempts;  ///< what is known of it and of those before it, for the statistics of the next one
};

/// Why a render's time is not to be trusted, from its statistics; empty if nothing speaks against it. `least`: seconds
/// per sample of the quickest render of the same method on the same scene; 0: unknown. Errors play no part: a choice by
/// them would bias what is measured.
std::string why_disturbed(const nlohmann::json& stats, double least);

/// What two renders must share for their times per sample to be compared: the method, the device, and the host where a
/// device's name does not say what it is, as of CPUs.
std::string time_class(const nlohmann::json& stats);

/// {time_class: seconds per sample of the quickest} of the statistics of one run's seeds.
std::map<std::string, double> least_seconds(const std::vector<nlohmann::json>& seeds);

/// The disturbed renders of what the folder holds. Images made elsewhere have no times of their own.
std::vector<Disturbed> find_disturbed(const ExperimentFolder& folder, const Prepared& prepared);

/// [{scene, run, seed, why, made}] for the manifest.
nlohmann::json to_json(const std::vector<Disturbed>& renders, const ExperimentConfig& config);

}  // namespace ambilux
