// What variant aware of integrator bdpt has.
#pragma once

#include "integrators/bdpt/aware/settings.h"
#include "integrators/offers.h"
#include "integrators/setting.h"

namespace ambilux {

struct AwareVariant {
    static constexpr const char* kHelp =
        "lvc with a number of connections for each pixel (efficiency-aware, Grittmann et al. 2022), which "
        "bdpt.auto=true with selector=efficiency finds";
    static constexpr VariantTraits kTraits = {.strategies = true,
                                              .light_subpaths = true,
                                              .draws = true,
                                              .draws_together = true,
                                              .repeats = false,
                                              .references = References::as_it_is};

    static std::vector<Declaration<AwareSettings>> settings();
    static uint32_t strategies(const RenderSettings& settings);
    static std::vector<SelectionOffer> selection(const SelectionRequest& r) {
        const bool images = r.settings.technique_depth > 0;  // of strategies, which it does not gather
        if (r.settings.selector != Selector::efficiency || r.light_paths == 0.0f || !r.may_draw() || images) return {};
        SelectionOffer offer = {", aware, connections by pixel", {{"strategies", "all"}}, true, 1, 1};
        offer.by_pixel = true;
        return {offer};
    }
    static std::vector<Stressed> stress() { return {{"aware", {{"connections_map", "3x2:412841"}}}}; }
};

}  // namespace ambilux
