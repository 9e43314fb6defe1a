// What integrator bdpt has where every eye subpath is connected with the light subpath of its slot, and integrator
// light, which is bdpt without all but its strategies t = 1.
#pragma once

#include "integrators/offers.h"

namespace ambilux {

struct WavefrontVariant {
    static constexpr const char* kHelp =
        "bidirectional path tracer: every eye subpath is connected with a light subpath of its own";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .strategy_images = true,
                                              .light_tree = true,
                                              .sobol = true,
                                              .in_double = true,
                                              .selects_any = true,
                                              .replay = ReplayPairing::own_subpath,
                                              .references = References::as_it_is};

    /// Without connections any number of light subpaths will do, and variants with a cache have no use for it.
    static std::vector<SelectionOffer> selection(const SelectionRequest& r) {
        if (r.itself && r.light_paths == 1.0f) return paired_offers(r, ", wavefront");
        if (r.light_paths == 0.0f || !(r.itself || r.asked.draws)) return {};
        return {without_connections()};
    }
    static std::vector<Stressed> stress() { return both_heuristics("bdpt", true); }
};

struct LightVariant {
    static constexpr const char* kHelp = "light tracer: vertices of light subpaths are connected with the camera";
    static constexpr VariantTraits kTraits = {.light_subpaths = true,
                                              .strategy_images = true,
                                              .sobol = true,
                                              .in_double = true,
                                              .replay = ReplayPairing::own_subpath};

    static uint32_t strategies(const RenderSettings&) { return kLightStrategies; }
    static std::vector<Stressed> stress() { return both_heuristics("light"); }
};

}  // namespace ambilux
