// What a variant offers to those who render with several: to bdpt.auto=true (render/selection.h) and to stress.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "integrators/settings.h"
#include "integrators/variant_traits.h"

namespace ambilux {

using SettingTexts = std::vector<std::pair<std::string, std::string>>;

/// What a variant is asked to offer candidates for.
struct SelectionRequest {
    const RenderSettings& settings;
    const VariantTraits& asked;  ///< of the variant that `settings` name
    bool itself;                 ///< it is this one
    bool cuda;
    float light_paths;  ///< light subpaths per pixel; 0: of variants that have none

    /// Draws from a cache: on a device it has another order in every run.
    bool may_draw() const { return asked.draws || (asked.selects_any && !(cuda && settings.deterministic)); }
};

/// A candidate. All have hits and next event estimation.
struct SelectionOffer {
    std::string suffix;         ///< of its name, after the integrator's
    SettingTexts settings;      ///< beside integrator, variant and light_paths
    bool connect = false;       ///< connections
    uint32_t draws = 0;         ///< of each eye vertex from a cache; 0: subpaths are paired
    uint32_t worth = 0;         ///< uniform draws that they are taken to be worth
    double work = 1.0;          ///< for that much more work of all kinds
    double least_subpaths = 0;  ///< eye subpaths of a render from which on it may be selected
    bool by_pixel = false;      ///< the draws of each pixel follow from the other candidates' (render/by_pixel.h)
    bool measured = false;  ///< no pilot predicts it: a few samples are compared with those of the best of the others
};

/// With all strategies but connections, whatever the variant.
inline SelectionOffer without_connections() {
    return {" without connections", {{"strategies", "hits+next_event+light"}}};
}
/// Of a variant that pairs subpaths in a way of its own: only if it was asked for.
inline std::vector<SelectionOffer> paired_offers(const SelectionRequest& r, std::string suffix) {
    if (!r.itself || r.light_paths != 1.0f) return {};
    return {without_connections(), {std::move(suffix), {{"strategies", "all"}}, true}};
}

/// A method that stress renders every cell with.
struct Stressed {
    std::string name;
    SettingTexts settings = {};  ///< beside integrator and variant
    bool quick = true;           ///< part of --quick
    double bias = 0;             ///< share of the answer that its mean may be off, of methods that are not unbiased
};

/// With the balance and with the power heuristic.
inline std::vector<Stressed> both_heuristics(const std::string& name, bool power_is_quick = false) {
    return {{name}, {name + "-power", {{"heuristic", "power"}}, power_is_quick}};
}

}  // namespace ambilux
