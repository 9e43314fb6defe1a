// The declaration of a setting: command line, statistics, image attributes, configurations of experiments, help and
// docs/reference.md follow from it.
#pragma once

#include <fmt/ranges.h>

#include <functional>
#include <variant>

#include "integrators/parse_value.h"
#include "integrators/settings.h"
#include "integrators/variant_traits.h"

namespace ambilux {

using SettingValue = std::variant<bool, int64_t, uint64_t, float, std::string>;

/// As the parser of the setting takes it.
std::string text_of(const SettingValue& value);

/// A setting that is a field of `S`.
template <class S>
struct Declaration {
    std::string key, allowed, help;  ///< `help`: what it is, one sentence without a capital and a full stop
    std::function<void(S&, const std::string& value)> set;  ///< throws Error(usage)
    std::function<SettingValue(const S&)> get;
};

/// Declarations of fields of `S`. `field`: a pointer to a member, or a function that returns a reference to it.
template <class S>
struct Declare {
    using Names = std::vector<std::string>;

    /// An enumeration whose values have `names`, in their order.
    template <class Field>
    static Declaration<S> choice(const std::string& key, Field field, Names names, std::string help) {
        return {key, fmt::format("{}", fmt::join(names, ", ")), std::move(help),
                [=](S& s, const std::string& value) {
                    auto& place = std::invoke(field, s);
                    place = enumeration<std::decay_t<decltype(place)>>(parse_choice(key, value, names));
                },
                [=](const S& s) -> SettingValue {
                    const auto& place = std::invoke(field, s);
                    return names[size_t(enumeration<std::decay_t<decltype(place)>>(place))];
                }};
    }
    template <class Field>
    static Declaration<S> flag(const std::string& key, Field field, std::string help) {
        return {key, "false, true", std::move(help),
                [=](S& s, const std::string& value) {
                    std::invoke(field, s) = parse_choice(key, value, {"false", "true"}) == 1;
                },
                [=](const S& s) -> SettingValue { return bool(std::invoke(field, s)); }};
    }
    /// An integer or a float in [lowest, highest].
    template <class Field, class Number>
    static Declaration<S> number(const std::string& key, Field field, Number lowest, Number highest, std::string help) {
        return {key, allowed_numbers(lowest, highest), std::move(help),
                [=](S& s, const std::string& value) {
                    std::invoke(field, s) = parse_number<Number>(key, value, lowest, highest);
                },
                [=](const S& s) -> SettingValue {
                    if constexpr (std::is_floating_point_v<Number>)
                        return float(std::invoke(field, s));
                    else if constexpr (std::is_signed_v<Number>)
                        return int64_t(std::invoke(field, s));
                    else
                        return uint64_t(std::invoke(field, s));
                }};
    }

private:
    template <class T, class Value>
    static auto enumeration(const Value& value) {
        if constexpr (std::is_enum_v<T>)
            return T(value);
        else
            return typename T::Enum(value);
    }
};

/// True where a setting, or one of its values, has an effect.
using Applies = bool (*)(const VariantTraits&, bool cuda);

/// Who decides about a setting in an experiment.
enum class InExperiment : uint32_t {
    run,         ///< the table `set` of a run
    run_key,     ///< a run, by a key of its own
    experiment,  ///< the experiment or its scenes: refused in a run
};

/// A setting and where it belongs.
struct Setting {
    Declaration<RenderSettings> what;
    Applies applies = nullptr;  ///< null: everywhere
    std::string because;        ///< why only there
    struct Limit {
        std::string value;
        Applies applies;
        std::string because;
    };
    std::vector<Limit> limits;                                 ///< values with an effect in some places only
    std::function<SettingValue(const RenderSettings&)> shown;  ///< in statistics, if not what.get
    std::string against_auto;   ///< why it cannot be combined with bdpt.auto=true; empty: it can
    bool of_auto = false;       ///< has an effect with bdpt.auto=true alone
    bool left_to_auto = false;  ///< with bdpt.auto=true it need not apply to the variant that was asked for
    bool in_images = false;     ///< an attribute of image files, where it applies
    bool partial = false;       ///< leaves something out: not in a reference
    InExperiment place = InExperiment::run;
    std::string place_text;  ///< what it belongs to instead of a run

    Setting(Declaration<RenderSettings> declaration) : what(std::move(declaration)) {}

    Setting where(Applies a, std::string why) && { return applies = a, because = std::move(why), std::move(*this); }
    Setting limit(std::string value, Applies a, std::string why) && {
        return limits.push_back({std::move(value), a, std::move(why)}), std::move(*this);
    }
    Setting not_with_auto(std::string why) && { return against_auto = std::move(why), std::move(*this); }
    Setting only_with_auto() && { return of_auto = true, std::move(*this); }
    Setting chosen_by_auto() && { return left_to_auto = true, std::move(*this); }
    Setting image_attribute() && { return in_images = true, std::move(*this); }
    Setting leaves_out() && { return partial = true, std::move(*this); }
    Setting key_of_runs() && { return place = InExperiment::run_key, std::move(*this); }
    Setting not_in_runs(std::string text) && {
        return place = InExperiment::experiment, place_text = std::move(text), std::move(*this);
    }

    std::string text(const RenderSettings& s) const { return text_of(what.get(s)); }
    std::string default_text() const { return text(RenderSettings()); }
    bool is_default(const RenderSettings& s) const { return text(s) == default_text(); }
    bool applies_to(const VariantTraits& traits, bool cuda) const { return !applies || applies(traits, cuda); }
};

/// All settings but those that variants declare for themselves, in the order of the help.
const std::vector<Setting>& general_settings();

/// Null if there is none of this key.
const Setting* find_general_setting(const std::string& key);

/// The values that `settings` hold for the declarations of a variant's own struct.
template <class S>
S own_settings(const std::vector<Declaration<S>>& declarations, const RenderSettings& settings) {
    S own;
    for (const Declaration<S>& d : declarations)
        if (const auto value = settings.own.find(d.key); value != settings.own.end()) d.set(own, value->second);
    return own;
}

/// A variant's own setting as one of the render: its text is kept in RenderSettings::own.
template <class S>
Setting own_setting(const Declaration<S>& d) {
    const auto set = [d](RenderSettings& settings, const std::string& value) {
        S parsed;
        d.set(parsed, value);
        settings.own[d.key] = text_of(d.get(parsed));
    };
    const auto get = [d](const RenderSettings& settings) { return d.get(own_settings<S>({d}, settings)); };
    return Setting({d.key, d.allowed, d.help, set, get}).image_attribute();
}

}  // namespace ambilux
