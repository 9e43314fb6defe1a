#include "integrators/strategies_setting.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>

#include "integrators/parse_value.h"

namespace ambilux {
namespace {

const char* const kKey = "strategies";

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

/// Adds the single strategy `strategy`, called `name`, to `singles`.
void add_single(SingleStrategies& singles, Strategy strategy, const std::string& name, const std::string& value) {
    const uint32_t s = strategy.s(), t = strategy.t();
    if (t == 0 || s + t < 2 || strategy.segments() > SingleStrategies::kMaxSegments)
        refuse_value(
            kKey, value,
            fmt::format("'{}': t is at least 1, and s + t from 2 to {}", name, SingleStrategies::kMaxSegments + 1));
    uint8_t& slot = singles.s[strategy.segments()];
    if (slot != SingleStrategies::kNone && slot != s)
        refuse_value(kKey, value,
                     fmt::format("'{}' and 's{}t{}' sample the same paths; single strategies have weight 1, so only "
                                 "one for each s + t can be on",
                                 name, slot, s + t - slot));
    slot = uint8_t(s);
    singles.on = true;
}

}  // namespace

std::string allowed_strategies() {
    return fmt::format("all; some of {} joined by +; or single ones such as s1t2+s2t2, one of each length",
                       fmt::join(kStrategyGroups, ", "));
}

void set_strategies(RenderSettings& settings, const std::string& value) {
    uint32_t bits = value == "all" ? uint32_t(kAllStrategies) : 0;
    bool groups = false;
    SingleStrategies singles;
    std::fill(std::begin(singles.s), std::end(singles.s), SingleStrategies::kNone);
    for (size_t start = 0; value != "all" && start <= value.size();) {
        const size_t end = std::min(value.find('+', start), value.size());
        const std::string name = value.substr(start, end - start);
        start = end + 1;
        if (const auto strategy = single_strategy(name)) {
            add_single(singles, *strategy, name, value);
            bits |= group_of(*strategy);
            continue;
        }
        const auto at = std::find(kStrategyGroups.begin(), kStrategyGroups.end(), name);
        if (at == kStrategyGroups.end())
            refuse_value(
                kKey, value,
                fmt::format("'{}' is none of {} and no single strategy such as s2t3; join them with '+', or write all",
                            name, fmt::join(kStrategyGroups, ", ")));
        bits |= 1u << (at - kStrategyGroups.begin());
        groups = true;
    }
    if (groups && singles.on) refuse_value(kKey, value, "groups and single strategies cannot be mixed");
    settings.strategies = bits;
    settings.singles = singles.on ? singles : SingleStrategies{};
}

std::string strategies_text(const RenderSettings& settings) {
    std::vector<std::string> names;
    if (settings.singles.on) {
        for (uint32_t k = 1; k <= SingleStrategies::kMaxSegments; ++k)
            if (const uint8_t s = settings.singles.s[k]; s != SingleStrategies::kNone)
                names.push_back(fmt::format("s{}t{}", s, k + 1 - s));
    } else if ((settings.strategies & kAllStrategies) == kAllStrategies) {
        names.emplace_back("all");
    } else {
        for (size_t g = 0; g < kStrategyGroups.size(); ++g)
            if (settings.strategies >> g & 1) names.push_back(kStrategyGroups[g]);
    }
    return fmt::format("{}", fmt::join(names, "+"));
}

}  // namespace ambilux
