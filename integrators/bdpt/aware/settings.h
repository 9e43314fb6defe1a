// Settings of variant aware.
#pragma once

#include <vector>

#include "integrators/settings.h"
#include "scene/scene.h"

namespace ambilux {

/// How many light vertices eye vertices draw: for blocks of pixels, row by row.
struct ConnectionsMap {
    uint32_t x = 0, y = 0;         ///< blocks along the sides of the film
    std::vector<uint16_t> counts;  ///< none: `connections` for all pixels

    /// "XxY:" and a digit for each block; throws Error(usage).
    static ConnectionsMap parse(const std::string& text);
    std::string text() const;
    uint32_t least() const;
    uint32_t most() const;
};

struct AwareSettings {
    ConnectionsMap map;

    /// With a map of one block where none is given.
    static AwareSettings plan(const RenderSettings& settings);
    /// Throws Error(usage) where pixels without connections would lack light.
    void check(const Scene& scene, const RenderSettings& settings) const;
};

}  // namespace ambilux
