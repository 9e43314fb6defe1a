// All variants of integrators. Each has a folder; integrators/registry.list has a line for each, from which CMake makes
// the list behind variants() and the renderers.
#pragma once

#include <string>
#include <vector>

#include "integrators/offers.h"
#include "integrators/setting.h"

namespace ambilux {

/// A variant of an integrator.
struct Variant {
    std::string integrator, variant;
    VariantTraits traits;
    std::string help;               ///< one sentence
    std::vector<Setting> own = {};  ///< settings that only this variant has
    /// The groups (StrategyBits) that it samples; null: none that this notation describes.
    uint32_t (*strategies)(const RenderSettings&) = nullptr;
    std::string (*bias)(const RenderSettings&) = nullptr;                         ///< null: unbiased
    std::vector<SelectionOffer> (*selection)(const SelectionRequest&) = nullptr;  ///< null: it is never selected
    std::vector<Stressed> stress = {};
    bool outside = false;  ///< of the tree (AMBILUX_EXTENSIONS)

    bool is(const std::string& of_integrator, const std::string& of_variant) const {
        return integrator == of_integrator && variant == of_variant;
    }
    std::string name() const { return integrator + " " + variant; }
    /// Null if it declares no setting of this key.
    const Setting* find_own(const std::string& key) const;
};

/// What `Description` (a folder's variant.h) says of itself: kTraits and kHelp, and what it has of settings(),
/// strategies(settings), bias(settings), selection(request) and stress(). Without these, it is unbiased, never selected
/// and stressed as it is.
template <class Description>
Variant describe(const std::string& integrator, const std::string& variant) {
    Variant v = {integrator, variant, Description::kTraits, Description::kHelp};
    if constexpr (requires { Description::settings(); })
        for (const auto& declaration : Description::settings()) v.own.push_back(own_setting(declaration));
    if constexpr (requires { Description::strategies; })
        v.strategies = Description::strategies;
    else if (v.traits.strategies)
        v.strategies = [](const RenderSettings& settings) { return settings.strategies; };
    if constexpr (requires { Description::bias; }) v.bias = Description::bias;
    if constexpr (requires { Description::selection; }) v.selection = Description::selection;
    if constexpr (requires { Description::stress; })
        v.stress = Description::stress();
    else
        v.stress = {{variant == RenderSettings().variant ? integrator : integrator + "-" + variant}};
    return v;
}

/// `v` as one outside of the tree.
inline Variant outside(Variant v) {
    v.outside = true;
    return v;
}

/// In the order of integrators/registry.list, then those of AMBILUX_EXTENSIONS.
const std::vector<Variant>& variants();

/// Names, each once.
std::vector<std::string> integrator_names(bool in_tree = false);
std::vector<std::string> variant_names(bool in_tree = false);

/// Names of integrators that have a variant of such traits, and of those variants.
using Has = bool (*)(const VariantTraits&);
std::vector<std::string> integrators_that(Has has);
std::vector<std::string> variants_that(Has has, const std::string& integrator);

/// Those that find all light, as ground truth must.
std::vector<std::string> reference_integrators();
bool makes_references(const std::string& integrator);

/// Null if there is none of this name.
const Variant* find_variant(const std::string& integrator, const std::string& variant);
/// The variant that `settings` name. Throws Error(usage).
const Variant& variant_of(const RenderSettings& settings);

/// Where a setting has an effect: "everywhere", or which variants on which backend. `in_tree`: names none outside.
std::string applies_text(Applies applies, bool in_tree = false);

/// Throws Error(usage) that names the first setting, or value, without an effect on `variant`: whoever sets it expects
/// one.
void check_settings(const RenderSettings& settings, const Variant& variant, bool cuda);

/// How far the mean of an image lies from the truth, and whether it goes there; empty: it is the truth. A phrase such
/// as "consistent, biased by a radius of 0.003 of the scene's".
std::string bias_text(const RenderSettings& settings);

/// The setting strategies in statistics: of variants that have none to choose from, what they sample.
SettingValue shown_strategies(const RenderSettings& settings);

}  // namespace ambilux
