#include "experiments/disturbed.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "core/atomic_file.h"
#include "experiments/peers/peer.h"

namespace ambilux {
namespace {

using nlohmann::json;

double seconds_of(const json& stats) {
    const json& seconds = stats.value("seconds", json::object());
    return seconds.is_object() ? seconds.value("render", 0.0) : 0.0;
}

/// 0: unknown.
double per_sample(const json& stats) {
    const double samples = stats.value("spp", 0.0);
    return samples > 0 ? seconds_of(stats) / samples : 0.0;
}

json machine_of(const json& stats) {
    const auto found = stats.find("machine");
    return found != stats.end() && found->is_array() ? *found : json::array();
}

/// Share of the cores that others held, over all parts of the render.
double share_of_others(const json& machine) {
    double seconds = 0, held = 0;
    for (const json& part : machine) {
        const double lasted = part.value("seconds", 0.0);
        seconds += lasted;
        held += lasted * part.value("other_cores", 0.0) / std::max(1.0, part.value("cores", 1.0));
    }
    return seconds > 0 ? held / seconds : 0.0;
}

/// A device's own limit of power is what it is sold with; all else is trouble.
std::string slowdown_of(const json& machine) {
    for (const json& part : machine) {
        const auto gpu = part.find("gpu");
        if (gpu == part.end() || !gpu->is_object()) continue;
        for (const json& name : gpu->value("slowdowns", json::array()))
            if (name != "power cap") return name.get<std::string>();
    }
    return "";
}

json read_stats(const std::string& path) {
    if (!std::filesystem::exists(path)) return nullptr;
    json stats = json::parse(read_file(path), nullptr, false);
    return stats.is_object() ? stats : json(nullptr);
}

}  // namespace

std::string why_disturbed(const json& stats, double least) {
    const json machine = machine_of(stats);
    if (seconds_of(stats) < kShortestJudged) return "";
    if (const double share = share_of_others(machine); share > kBusyShare)
        return fmt::format("other processes held {:.0f} % of the cores", 100 * share);
    if (const std::string slowdown = slowdown_of(machine); !slowdown.empty())
        return fmt::format("the clocks of the device were held down: {}", slowdown);
    const double own = per_sample(stats);
    if (least > 0 && own > kSlowSample * least)
        return fmt::format("a sample took {:.2f} times as long as with another seed", own / least);
    return "";
}

std::string time_class(const json& stats) {
    const auto text = [](const json& j, const char* key) {
        const auto found = j.find(key);
        return found != j.end() && found->is_string() ? found->get<std::string>() : std::string();
    };
    const json machine = machine_of(stats);
    const bool named = text(stats, "backend") == "cuda";
    return fmt::format("{} on {} {}", text(stats, "method"), text(stats, "device"),
                       named || machine.empty() ? "" : text(machine.back(), "host"));
}

std::map<std::string, double> least_seconds(const std::vector<json>& seeds) {
    std::map<std::string, double> least;
    for (const json& stats : seeds) {
        const double own = stats.is_object() && seconds_of(stats) >= kShortestJudged ? per_sample(stats) : 0.0;
        if (!(own > 0)) continue;
        const auto at = least.emplace(time_class(stats), own).first;
        at->second = std::min(at->second, own);
    }
    return least;
}

std::vector<Disturbed> find_disturbed(const ExperimentFolder& folder, const Prepared& prepared) {
    const ExperimentConfig& config = prepared.config;
    std::vector<Disturbed> found;
    for (size_t scene = 0; scene < prepared.scenes.size(); ++scene)
        for (size_t run = 0; run < config.runs.size(); ++run) {
            const RunEntry& entry = config.runs[run];
            if (!entry.renderer.empty() && !find_peer_kind(entry.renderer)->tested) continue;
            std::vector<json> seeds;
            for (const uint64_t seed : config.seeds)
                seeds.push_back(read_stats(
                    folder.file("stats", prepared.scenes[scene], fmt::format("{}_{}.json", entry.name, seed))));
            std::map<std::string, double> least = least_seconds(seeds);
            for (size_t i = 0; i < seeds.size(); ++i) {
                if (!seeds[i].is_object()) continue;
                const std::string why = why_disturbed(seeds[i], least[time_class(seeds[i])]);
                if (why.empty()) continue;
                json attempts = seeds[i].value("attempts", json::array());
                attempts.push_back({{"why", why},
                                    {"seconds_per_sample", per_sample(seeds[i])},
                                    {"method", seeds[i].value("method", "")},
                                    {"machine", machine_of(seeds[i])}});
                found.push_back({scene, run, config.seeds[i], why, attempts});
            }
        }
    return found;
}

json to_json(const std::vector<Disturbed>& renders, const ExperimentConfig& config) {
    json list = json::array();
    for (const Disturbed& d : renders)
        list.push_back({{"scene", config.scenes[d.scene].name},
                        {"run", config.runs[d.run].name},
                        {"seed", d.seed},
                        {"why", d.why},
                        {"made", d.attempts.size()}});
    return list;
}

}  // namespace ambilux
