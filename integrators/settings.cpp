#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <vector>

#include "core/error.h"
#include "integrators/renderer.h"
#include "stages/wave.h"

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

/// Names joined by '+', such as "hits+next_event".
uint32_t strategies(const std::string& key, const std::string& value) {
    if (value == "all") return kAllStrategies;
    const std::vector<std::string> names = {"hits", "next_event", "connections", "light"};
    uint32_t bits = 0;
    for (size_t start = 0; start <= value.size();) {
        const size_t end = std::min(value.find('+', start), value.size());
        const std::string name = value.substr(start, end - start);
        const auto at = std::find(names.begin(), names.end(), name);
        if (at == names.end()) refuse(key, value, fmt::format("'{}' is none of {}; join them with '+', or write all", name, fmt::join(names, ", ")));
        bits |= 1u << (at - names.begin());
        start = end + 1;
    }
    return bits;
}

bool boolean(const std::string& key, const std::string& value) { return choose(key, value, {"false", "true"}) == 1; }

}  // namespace

void apply_setting(RenderSettings& s, const std::string& key, const std::string& value) {
    if (key == "integrator")
        s.integrator = (choose(key, value, {"path", "light", "bdpt"}), value);
    else if (key == "variant")
        s.variant = (choose(key, value, {"wavefront", "megakernel", "lvc"}), value);
    else if (key == "backend")
        s.backend = (choose(key, value, {"auto", "cpu", "cuda"}), value);
    else if (key == "estimator")
        s.estimator = Estimator(choose(key, value, {"naive", "nee", "mis"}));
    else if (key == "heuristic")
        s.heuristic = MisHeuristic(choose(key, value, {"balance", "power"}));
    else if (key == "strategies")
        s.strategies = strategies(key, value);
    else if (key == "connections")
        s.connections = integer<uint32_t>(key, value, 1, kMaxCacheDraws);
    else if (key == "max_depth")
        s.max_depth = integer(key, value, -1, (1 << 14) - 2);
    else if (key == "rr_depth")
        s.rr_depth = integer(key, value, -1, 1 << 14);
    else if (key == "seed")
        s.seed = integer<uint64_t>(key, value, 0, ~0ull);
    else if (key == "accel")
        s.accel = (choose(key, value, {"auto", "embree", "cwbvh"}), value);
    else if (key == "wave_size")
        s.wave_size = integer<uint32_t>(key, value, 0, 1u << 28);
    else if (key == "specialise")
        s.specialise = boolean(key, value);
    else if (key == "deterministic")
        s.deterministic = boolean(key, value);
    else if (key == "graph")
        s.graph = boolean(key, value);
    else
        throw Error(ExitCode::usage,
                    fmt::format("unknown setting '{}': known are integrator, variant, backend, estimator, heuristic, strategies, connections, max_depth, rr_depth, seed, accel, wave_size, specialise, deterministic, graph", key));
}

}  // namespace ambilux
