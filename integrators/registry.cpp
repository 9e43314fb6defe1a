#include "integrators/registry.h"

#include <algorithm>

#include "core/error.h"
#include "integrators/strategies_setting.h"

namespace ambilux {
namespace {

std::vector<std::string> names_of(std::string Variant::* name, bool in_tree = false) {
    std::vector<std::string> names;
    for (const Variant& v : variants())
        if (!(in_tree && v.outside) && std::find(names.begin(), names.end(), v.*name) == names.end())
            names.push_back(v.*name);
    return names;
}

bool find_all_light(const VariantTraits& traits) { return traits.references != References::none; }

/// "path, bdpt (lvc, streaming)": all variants of an integrator, or some.
std::string list_variants(Applies applies, bool cuda, bool in_tree) {
    std::vector<std::string> parts;
    for (const std::string& integrator : names_of(&Variant::integrator, in_tree)) {
        std::vector<std::string> some;
        bool all = true;
        for (const Variant& v : variants()) {
            if (v.integrator != integrator || (in_tree && v.outside)) continue;
            if (applies(v.traits, cuda))
                some.push_back(v.variant);
            else
                all = false;
        }
        if (!some.empty())
            parts.push_back(all ? integrator : fmt::format("{} ({})", integrator, fmt::join(some, ", ")));
    }
    return fmt::format("{}", fmt::join(parts, ", "));
}

/// What settings are asked of.
struct Place {
    const RenderSettings& settings;
    const Variant& variant;
    bool cuda;

    bool has(Applies applies) const { return !applies || applies(variant.traits, cuda); }
    [[noreturn]] void refuse(const std::string& key, const std::string& value, const std::string& why,
                             const std::string& where) const {
        throw Error(ExitCode::usage,
                    fmt::format("{}={}: {}; this is integrator {}, variant {}, backend {}{}", key, value, why,
                                variant.integrator, variant.variant, cuda ? "cuda" : "cpu", where));
    }
    [[noreturn]] void refuse(const std::string& key, const std::string& value, const std::string& why,
                             Applies applies) const {
        refuse(key, value, why, fmt::format(". It has an effect on {}", applies_text(applies)));
    }
};

void check(const Setting& s, const Place& at) {
    const std::string value = s.text(at.settings);
    const bool asked = value != s.default_text(), open = at.settings.automatic && s.left_to_auto;
    if (asked && !open && !at.has(s.applies)) at.refuse(s.what.key, value, s.because, s.applies);
    for (const Setting::Limit& limit : s.limits)
        if (value == limit.value && !at.has(limit.applies)) at.refuse(s.what.key, value, limit.because, limit.applies);
    if (asked && s.of_auto && !at.settings.automatic)
        at.refuse(s.what.key, value, "it has an effect with bdpt.auto=true alone", "");
    if (asked && at.settings.automatic && !s.against_auto.empty()) at.refuse(s.what.key, value, s.against_auto, "");
}

}  // namespace

const Setting* Variant::find_own(const std::string& key) const {
    const auto at = std::find_if(own.begin(), own.end(), [&](const Setting& s) { return s.what.key == key; });
    return at == own.end() ? nullptr : &*at;
}

std::vector<std::string> integrator_names(bool in_tree) { return names_of(&Variant::integrator, in_tree); }
std::vector<std::string> variant_names(bool in_tree) { return names_of(&Variant::variant, in_tree); }

std::vector<std::string> integrators_that(Has has) {
    std::vector<std::string> names;
    for (const std::string& name : integrator_names())
        if (!variants_that(has, name).empty()) names.push_back(name);
    return names;
}
std::vector<std::string> variants_that(Has has, const std::string& integrator) {
    std::vector<std::string> names;
    for (const Variant& v : variants())
        if (v.integrator == integrator && has(v.traits)) names.push_back(v.variant);
    return names;
}

std::vector<std::string> reference_integrators() { return integrators_that(find_all_light); }
bool makes_references(const std::string& integrator) { return !variants_that(find_all_light, integrator).empty(); }

const Variant* find_variant(const std::string& integrator, const std::string& variant) {
    for (const Variant& v : variants())
        if (v.is(integrator, variant)) return &v;
    return nullptr;
}

const Variant& variant_of(const RenderSettings& settings) {
    if (const Variant* v = find_variant(settings.integrator, settings.variant)) return *v;
    // Names may come from elsewhere than apply_setting.
    parse_choice("integrator", settings.integrator, integrator_names());
    parse_choice("variant", settings.variant, variant_names());
    std::vector<std::string> names;
    for (const Variant& v : variants())
        if (v.integrator == settings.integrator) names.push_back(v.variant);
    throw Error(ExitCode::usage, fmt::format("variant={}: integrator {} has {}", settings.variant, settings.integrator,
                                             names.size() > 1 ? fmt::format("the variants {}", fmt::join(names, ", "))
                                                              : fmt::format("the variant {} only", names[0])));
}

std::string applies_text(Applies applies, bool in_tree) {
    const auto never = [](const VariantTraits&, bool) { return false; };
    const auto always = [](const VariantTraits&, bool) { return true; };
    if (!applies) applies = always;
    const auto list = [in_tree](Applies a, bool on_cuda) { return list_variants(a, on_cuda, in_tree); };
    const std::string cpu = list(applies, false), cuda = list(applies, true);
    const std::string all = list(always, false), none = list(never, false);
    const auto text = [&](const std::string& some) { return some == all ? std::string("all integrators") : some; };
    if (cpu == cuda) return text(cpu);
    if (cpu == none) return text(cuda) + " on cuda";
    if (cuda == none) return text(cpu) + " on cpu";
    return fmt::format("{} on cpu, {} on cuda", text(cpu), text(cuda));
}

void check_settings(const RenderSettings& settings, const Variant& variant, bool cuda) {
    const Place at = {settings, variant, cuda};
    for (const Setting& s : general_settings()) check(s, at);
    for (const auto& [key, value] : settings.own) {
        if (const Setting* own = variant.find_own(key)) {
            RenderSettings parsed;
            own->what.set(parsed, value);  // another variant's setting of this key may allow more
            continue;
        }
        std::vector<std::string> owners;
        for (const Variant& v : variants())
            if (v.find_own(key)) owners.push_back(v.name());
        at.refuse(key, value, "this integrator has no such setting",
                  fmt::format(". It belongs to {}", fmt::join(owners, ", ")));
    }
}

std::string bias_text(const RenderSettings& settings) {
    const Variant* v = find_variant(settings.integrator, settings.variant);
    return v && v->bias ? v->bias(settings) : "";
}

SettingValue shown_strategies(const RenderSettings& settings) {
    const Variant* v = find_variant(settings.integrator, settings.variant);
    if (!v || !v->traits.light_subpaths || !v->strategies) return std::string();
    RenderSettings shown = settings;
    shown.strategies = v->strategies(settings);
    if (!v->traits.strategies) shown.singles = {};
    return strategies_text(shown);
}

}  // namespace ambilux
