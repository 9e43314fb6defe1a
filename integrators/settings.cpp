#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

#include "core/error.h"
#include "film/strategy_film.h"
#include "integrators/settings.h"

namespace ambilux {
namespace {

[[noreturn]] void refuse(const std::string& key, const std::string& value, const std::string& allowed) {
    throw Error(ExitCode::usage, fmt::format("{}={}: {}", key, value, allowed));
}

/// Index of `value` among `names`.
size_t choose(const std::string& key, const std::string& value, const std::vector<std::string>& names) {
    const auto at = std::find(names.begin(), names.end(), value);
    if (at == names.end()) refuse(key, value, fmt::format("allowed are {}", fmt::join(names, ", ")));
    return size_t(at - names.begin());
}

template <class Integer>
Integer integer(const std::string& key, const std::string& value, Integer lowest, Integer highest) {
    Integer result{};
    const char* end = value.data() + value.size();
    const auto parsed = std::from_chars(value.data(), end, result);
    if (parsed.ec != std::errc() || parsed.ptr != end || result < lowest || result > highest)
        refuse(key, value, fmt::format("an integer from {} to {} is needed", lowest, highest));
    return result;
}

/// Groups of strategies, in the order of StrategyBits.
const std::vector<std::string> kStrategyGroups = {"hits", "next_event", "connections", "light"};

/// The strategy that "s2t3" names, if that is how `name` is built.
std::optional<Strategy> single_strategy(const std::string& name) {
    const char *at = name.data(), *end = at + name.size();
    const auto number = [&](char letter, uint32_t& n) {
        if (at == end || *at != letter) return false;
        const auto parsed = std::from_chars(at + 1, end, n);
        at = parsed.ptr;
        return parsed.ec == std::errc() && n <= SingleStrategies::kMaxSegments + 1;
    };
    uint32_t s = 0, t = 0;
    if (!number('s', s) || !number('t', t) || at != end) return {};
    return Strategy::make(s, t);
}

/// The group that samples a strategy.
uint32_t group_of(Strategy strategy) {
    if (strategy.s() == 0) return kHitStrategies;
    if (strategy.t() == 1) return kLightStrategies;
    return strategy.s() == 1 ? kNextEventStrategies : kConnectionStrategies;
}

/// Names joined by '+': groups, such as "hits+next_event", or single strategies, such as "s1t2+s2t2".
void set_strategies(RenderSettings& settings, const std::string& key, const std::string& value) {
    if (value == "all") {
        settings.strategies = kAllStrategies;
        settings.singles = {};
        return;
    }
    uint32_t bits = 0;
    SingleStrategies singles;
    std::fill(std::begin(singles.s), std::end(singles.s), SingleStrategies::kNone);
    bool groups = false;
    for (size_t start = 0; start <= value.size();) {
        const size_t end = std::min(value.find('+', start), value.size());
        const std::string name = value.substr(start, end - start);
        start = end + 1;
        if (const auto strategy = single_strategy(name)) {
            const uint32_t s = strategy->s(), t = strategy->t();
            if (t == 0 || s + t < 2 || strategy->segments() > SingleStrategies::kMaxSegments)
                refuse(key, value,
                       fmt::format("'{}': t is at least 1, and s + t from 2 to {}", name,
                                   SingleStrategies::kMaxSegments + 1));
            uint8_t& slot = singles.s[strategy->segments()];
            if (slot != SingleStrategies::kNone && slot != s)
                refuse(key, value,
                       fmt::format("'{}' and 's{}t{}' sample the same paths; single strategies have weight 1, so only "
                                   "one for each s + t can be on",
                                   name, slot, s + t - slot));
            slot = uint8_t(s);
            singles.on = true;
            bits |= group_of(*strategy);
            continue;
        }
        const auto at = std::find(kStrategyGroups.begin(), kStrategyGroups.end(), name);
        if (at == kStrategyGroups.end())
            refuse(
                key, value,
                fmt::format("'{}' is none of {} and no single strategy such as s2t3; join them with '+', or write all",
                            name, fmt::join(kStrategyGroups, ", ")));
        bits |= 1u << (at - kStrategyGroups.begin());
        groups = true;
    }
    if (groups && singles.on) refuse(key, value, "groups and single strategies cannot be mixed");
    settings.strategies = bits;
    settings.singles = singles;
}

float real(const std::string& key, const std::string& value, float lowest, float highest) {
    float result{};
    const char* end = value.data() + value.size();
    const auto parsed = std::from_chars(value.data(), end, result);
    if (parsed.ec != std::errc() || parsed.ptr != end || !(result >= lowest && result <= highest))
        refuse(key, value, fmt::format("a number from {} to {} is needed", lowest, highest));
    return result;
}

/// Light subpaths per pixel, where tiles of the film have a whole number of them.
uint32_t light_subpaths_per_tile(const std::string& key, const std::string& value) {
    const float per_tile = real(key, value, 1.0f / kTilePixels, kMostLightRounds) * kTilePixels;
    if (per_tile != std::floor(per_tile))
        refuse(key, value,
               fmt::format("multiples of 1/{} are needed; the next are {} and {}", kTilePixels,
                           std::floor(per_tile) / kTilePixels, std::ceil(per_tile) / kTilePixels));
    return uint32_t(per_tile);
}

bool boolean(const std::string& key, const std::string& value) { return choose(key, value, {"false", "true"}) == 1; }

}  // namespace

void apply_setting(RenderSettings& s, const std::string& key, const std::string& value) {
    if (key == "integrator")
        s.integrator = (choose(key, value, {"path", "light", "bdpt"}), value);
    else if (key == "variant")
        s.variant = (choose(key, value, {"wavefront", "megakernel", "lvc", "streaming"}), value);
    else if (key == "backend")
        s.backend = (choose(key, value, {"auto", "cpu", "cuda"}), value);
    else if (key == "estimator")
        s.estimator = Estimator(choose(key, value, {"naive", "nee", "mis"}));
    else if (key == "heuristic")
        s.heuristic = MisHeuristic(choose(key, value, {std::begin(Heuristics::kNames), std::end(Heuristics::kNames)}));
    else if (key == "strategies")
        set_strategies(s, key, value);
    else if (key == "technique_depth")
        s.technique_depth = integer<uint32_t>(key, value, 0, kMaxStrategyDepth);
    else if (key == "bdpt.auto")
        s.automatic = boolean(key, value);
    else if (key == "connections")
        s.connections = integer<uint32_t>(key, value, 1, kMaxCacheDraws);
    else if (key == "draws")
        s.draws = CacheDraws(choose(key, value, {"auto", "coherent", "independent"}));
    else if (key == "light_paths")
        s.light_subpaths_per_tile = light_subpaths_per_tile(key, value);
    else if (key == "max_depth")
        s.max_depth = integer(key, value, -1, (1 << 14) - 2);
    else if (key == "rr_depth")
        s.rr_depth = integer(key, value, -1, 1 << 14);
    else if (key == "seed")
        s.seed = integer<uint64_t>(key, value, 0, ~0ull);
    else if (key == "accel")
        s.accel = (choose(key, value, {"auto", "embree", "cwbvh", "bvh2"}), value);
    else if (key == "wave_size")
        s.wave_size = integer<uint32_t>(key, value, 0, 1u << 28);
    else if (key == "compaction")
        s.queues.compaction = Compaction(choose(key, value, {"atomic", "select", "none"}));
    else if (key == "ordering")
        s.queues.ordering = Ordering(choose(key, value, {"none", "material", "morton", "auto"}));
    else if (key == "specialise")
        s.specialise = boolean(key, value);
    else if (key == "fuse")
        s.fuse = Fuse(choose(key, value, {"auto", "none"}));
    else if (key == "cull")
        s.cull = real(key, value, 0.0f, 1.0f);
    else if (key == "tail")
        s.tail = boolean(key, value);
    else if (key == "deterministic")
        s.deterministic = boolean(key, value);
    else if (key == "graph")
        s.graph = boolean(key, value);
    else
        throw Error(
            ExitCode::usage,
            fmt::format(
                "unknown setting '{}': known are integrator, variant, backend, estimator, heuristic, "
                "strategies, technique_depth, bdpt.auto, connections, draws, light_paths, max_depth, rr_depth, seed, "
                "accel, wave_size, compaction, ordering, specialise, fuse, cull, tail, deterministic, graph",
                key));
}

std::string strategies_text(const RenderSettings& settings) {
    if (settings.integrator != "bdpt") return settings.integrator == "light" ? "light" : "";
    std::vector<std::string> names;
    if (settings.singles.on) {
        for (uint32_t k = 1; k <= SingleStrategies::kMaxSegments; ++k)
            if (const uint8_t s = settings.singles.s[k]; s != SingleStrategies::kNone)
                names.push_back(fmt::format("s{}t{}", s, k + 1 - s));
    } else if (settings.strategies == kAllStrategies) {
        names.emplace_back("all");
    } else {
        for (size_t g = 0; g < kStrategyGroups.size(); ++g)
            if (settings.strategies >> g & 1) names.push_back(kStrategyGroups[g]);
    }
    return fmt::format("{}", fmt::join(names, "+"));
}

}  // namespace ambilux
