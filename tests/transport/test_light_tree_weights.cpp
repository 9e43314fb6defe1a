// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 300
// Weights where next event estimation picks lights by a tree (transport/mis/by_tree.h): of all strategies that could
// have made a path, that one's density depends on the vertex next to the light.
#include "tests/support/bidirectional_paths.h"
#include "transport/mis/by_tree.h"

using namespace ambilux;
using namespace ambilux::test;

TEST_CASE("Weights with a tree over the lights equal those of all strategies enumerated, and sum to one") {
    const auto seen = compare_weights(0.25, [](uint32_t i) { return ByTree<BidirectionalMis>{settings(i)}; });
    for (const char* kind : {"hit", "escape", "next event", "connection", "light tracing"})
        for (const char* light :
             {"constant", "envmap", "mesh", "sphere", "disk", "cylinder", "point", "spot", "directional"}) {
            const std::string name = std::string(kind) + ", " + light;
            const bool found_by_rays = std::string(kind) == "hit" || std::string(kind) == "escape";
            if (found_by_rays && !seen.contains(name)) continue;
            INFO(name);
            CHECK(seen.at(name) >= 50);
        }
}
