// All that a render depends on, as bytes.
#pragma once

#include <fmt/format.h>

#include <string>

#include "scene/scene.h"

namespace ambilux::test {

inline std::string contents(const Scene& s) {
    std::string bytes;
    const auto add = [&](const auto& array) {
        bytes.append(reinterpret_cast<const char*>(array.data()), array.size() * sizeof array[0]);
    };
    add(s.vertices), add(s.triangles), add(s.quadrics), add(s.groups), add(s.instances), add(s.shapes),
        add(s.materials);
    add(s.bsdfs), add(s.textures), add(s.texels), add(s.sort_keys), add(s.emitters), add(s.emitter_cdf), add(s.tables);
    add(s.environment_rows), add(s.environment_cells);
    bytes.append(reinterpret_cast<const char*>(&s.sensor), sizeof s.sensor);
    const IntegratorHint& i = s.integrator;
    const Vec3f c = s.bounds_center;
    return bytes + fmt::format("{} {} {} {} {} {} {} {} {} {} {} {}", i.type, i.max_depth, i.rr_depth, i.spp,
                               i.hide_emitters, s.environment, c.x, c.y, c.z, s.bounds_radius, s.degenerate_triangles,
                               s.features.textures);
}

}  // namespace ambilux::test
