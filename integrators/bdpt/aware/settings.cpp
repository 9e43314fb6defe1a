#include "integrators/bdpt/aware/settings.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "integrators/bdpt/aware/variant.h"
#include "integrators/reachability.h"

namespace ambilux {

ConnectionsMap ConnectionsMap::parse(const std::string& text) {
    ConnectionsMap map;
    if (text.empty()) return map;
    const auto refuse = [&](const std::string& why) {
        throw Error(ExitCode::usage,
                    fmt::format("connections_map: {}; it is empty or \"XxY:\" and a digit for each block", why));
    };
    const size_t by = text.find('x'), colon = text.find(':');
    const auto number = [&](size_t from, size_t to) {
        const std::string digits = text.substr(from, to - from);
        if (digits.empty() || digits.size() > 5 || !std::all_of(digits.begin(), digits.end(), ::isdigit) ||
            std::stoul(digits) == 0)
            refuse(fmt::format("\"{}\" is no number of blocks", digits));
        return uint32_t(std::stoul(digits));
    };
    if (by == std::string::npos || colon == std::string::npos || by > colon) refuse("sizes are missing");
    map.x = number(0, by);
    map.y = number(by + 1, colon);
    for (size_t i = colon + 1; i < text.size(); ++i) {
        if (!::isdigit(text[i])) refuse(fmt::format("'{}' is no digit", text[i]));
        map.counts.push_back(uint16_t(text[i] - '0'));
    }
    if (map.counts.size() != size_t(map.x) * map.y)
        refuse(fmt::format("{} blocks have {} digits", size_t(map.x) * map.y, map.counts.size()));
    return map;
}

std::string ConnectionsMap::text() const {
    if (counts.empty()) return "";
    std::string digits;
    for (const uint16_t count : counts) digits += char('0' + count);
    return fmt::format("{}x{}:{}", x, y, digits);
}

uint32_t ConnectionsMap::least() const { return *std::min_element(counts.begin(), counts.end()); }
uint32_t ConnectionsMap::most() const { return *std::max_element(counts.begin(), counts.end()); }

std::vector<Declaration<AwareSettings>> AwareVariant::settings() {
    return {{"connections_map", "text",
             "light vertices that eye vertices draw, by blocks of pixels: columns and rows of blocks and a digit for "
             "each, row by row, as in 2x1:04; empty: connections for all",
             [](AwareSettings& s, const std::string& value) { s.map = ConnectionsMap::parse(value); },
             [](const AwareSettings& s) -> SettingValue { return s.map.text(); }}};
}

AwareSettings AwareSettings::plan(const RenderSettings& settings) {
    AwareSettings own = own_settings(AwareVariant::settings(), settings);
    if (own.map.counts.empty()) own.map = {1, 1, {uint16_t(settings.connections)}};
    return own;
}

uint32_t AwareVariant::strategies(const RenderSettings& settings) {
    return AwareSettings::plan(settings).map.most() > 0 ? settings.strategies
                                                        : settings.strategies & ~kConnectionStrategies;
}

void AwareSettings::check(const Scene& scene, const RenderSettings& settings) const {
    const uint32_t others = settings.strategies & ~kConnectionStrategies;
    if (map.least() > 0 || others == settings.strategies) return;
    const std::string path = unreachable_path(scene.features, others, settings.strategies, settings.max_depth);
    if (!path.empty())
        throw Error(ExitCode::usage,
                    fmt::format("connections_map has pixels without connections, but no other strategy finds light of "
                                "paths such as {}",
                                path));
}

}  // namespace ambilux
