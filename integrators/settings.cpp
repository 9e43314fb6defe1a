#include "integrators/settings.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/nearest.h"
#include "film/strategy_film.h"
#include "integrators/registry.h"
#include "integrators/strategies_setting.h"
#include "stages/cache_draw.h"
#include "transport/mis/heuristic.h"
#include "transport/subpath/subpath.h"

namespace ambilux {
namespace {

using Of = Declare<RenderSettings>;
using S = RenderSettings;

/// A name of integrators or variants; `field` keeps it.
Declaration<S> name_of(const std::string& key, std::string S::* field, std::vector<std::string> names,
                       std::string help) {
    return {key, fmt::format("{}", fmt::join(names, ", ")), std::move(help),
            [=](S& s, const std::string& value) { s.*field = names[parse_choice(key, value, names)]; },
            [=](const S& s) -> SettingValue { return s.*field; }};
}

Declaration<S> strategies() {
    return {"strategies", allowed_strategies(), "groups of strategies (s,t), or single ones",
            [](S& s, const std::string& value) { set_strategies(s, value); },
            [](const S& s) -> SettingValue { return strategies_text(s); }};
}

Declaration<S> memory() {
    const char* const key = "memory";
    return {key, "all, or bytes such as 512M or 4G (powers of 1024)",
            "most memory of a render, of each device or on the CPU; waves are planned for it",
            [=](S& s, const std::string& value) {
                if (value == "device" || value == "host" || value == "pinned")
                    refuse_value(key, value, "bytes are needed; where textures lie is the setting textures");
                s.memory = value == "all" ? 0 : parse_bytes(key, value);
            },
            [](const S& s) -> SettingValue { return s.memory ? text_of_bytes(s.memory) : "all"; }};
}

/// Light subpaths per pixel, where tiles of the film have a whole number of them.
Declaration<S> light_paths() {
    const char* const key = "light_paths";
    constexpr float kLeast = 1.0f / kTilePixels, kMost = float(kMostLightRounds);
    const auto set = [=](S& s, const std::string& value) {
        const float per_tile = parse_number(key, value, kLeast, kMost) * kTilePixels;
        if (per_tile != std::floor(per_tile))
            refuse_value(key, value,
                         fmt::format("multiples of 1/{} are needed; the next are {} and {}", kTilePixels,
                                     std::floor(per_tile) / kTilePixels, std::ceil(per_tile) / kTilePixels));
        s.light_subpaths_per_tile = uint32_t(per_tile);
    };
    return {key, fmt::format("{} in multiples of 1/{}", allowed_numbers(kLeast, kMost), kTilePixels),
            "light subpaths per pixel; in bdpt: lvc, aware, learned, guided, and wavefront without connections", set,
            [](const S& s) -> SettingValue { return float(s.light_subpaths_per_tile) / kTilePixels; }};
}

auto& compaction(auto& s) { return s.queues.compaction; }
auto& ordering(auto& s) { return s.queues.ordering; }

// Where settings have an effect.
bool has_estimators(const VariantTraits& v, bool) { return v.estimators; }
bool has_strategies(const VariantTraits& v, bool) { return v.strategies; }
bool has_light_subpaths(const VariantTraits& v, bool) { return v.light_subpaths; }
bool weighs(const VariantTraits& v, bool) { return v.weights; }
bool culls(const VariantTraits& v, bool) { return v.culls; }
bool gathers_strategies(const VariantTraits& v, bool) { return v.strategy_images; }
bool draws_vertices(const VariantTraits& v, bool) { return v.draws; }
bool draws_together(const VariantTraits& v, bool) { return v.draws_together; }
bool sorts(const VariantTraits& v, bool) { return v.sorts; }
bool compacts(const VariantTraits& v, bool) { return v.compacts; }
bool repeats(const VariantTraits& v, bool cuda) { return v.repeats || !cuda; }
bool has_binary_bvh(const VariantTraits& v, bool cuda) { return v.binary_bvh && cuda; }
bool has_launched_rays(const VariantTraits& v, bool cuda) { return !v.one_kernel && cuda; }
bool has_light_tree(const VariantTraits& v, bool) { return v.light_tree; }
bool has_sobol(const VariantTraits& v, bool) { return v.sobol; }
bool has_twin(const VariantTraits& v, bool cuda) { return v.in_double && !cuda; }
bool on_cpu(const VariantTraits&, bool cuda) { return !cuda; }
bool on_cuda(const VariantTraits&, bool cuda) { return cuda; }

const char* const kAutoChooses = "bdpt.auto=true chooses it; leave one of the two out";

/// What is rendered, where and how long its paths are.
std::vector<Setting> main_settings() {
    using Is = Setting;
    return {
        Is(name_of("integrator", &S::integrator, integrator_names(), "which paths are sampled"))
            .key_of_runs()
            .image_attribute(),
        Is(name_of("variant", &S::variant, variant_names(), "schedule, or variation, of the integrator"))
            .key_of_runs()
            .image_attribute(),
        Is(Of::choice("backend", &S::backend, {"auto", "cpu", "cuda"},
                      "where it runs; auto takes a CUDA device if there is one")),
        Is(Of::choice("precision", &S::precision, {"single", "double"},
                      "numbers that paths are computed with; double: a plain loop on the CPU, slow, as a reference for "
                      "rounding"))
            .limit("double", has_twin, "it has no twin in double precision")
            .image_attribute(),
        Is(Of::number("seed", &S::seed, uint64_t(0), ~uint64_t(0), "seed of all random numbers"))
            .not_in_runs("the experiment (seeds)")
            .image_attribute(),
        Is(Of::number("max_depth", &S::max_depth, -1, int(kMaxDepth) - 1,
                      "longest path in segments (2: direct light); -1: no limit. A scene may bring its own"))
            .not_in_runs("the experiment and its scenes (max_depth)")
            .image_attribute(),
        Is(Of::number("rr_depth", &S::rr_depth, -1, 1 << 14,
                      "Russian roulette starts at this many segments; -1: never. A scene may bring its own"))
            .image_attribute(),
        Is(Of::number("rr_cap", &S::rr_cap, 0.05f, 1.0f,
                      "highest probability with which a subpath survives Russian roulette; surfaces that reflect more "
                      "than its square root need more for a finite variance"))
            .image_attribute(),
        Is(Of::flag("deterministic", &S::deterministic, "same bits in every run on the same backend"))
            .limit("true", repeats, "a cache's order differs between runs on a CUDA device"),
        Is(Of::choice("accel", &S::accel, {"auto", "embree", "cwbvh", "bvh2", "optix"},
                      "what rays are traced through; auto: embree on the CPU, cwbvh on CUDA; optix: OptiX of the "
                      "driver, in builds with its headers"))
            .limit("embree", on_cpu, "the cuda backend has a structure of its own, cwbvh")
            .limit("bvh2", has_binary_bvh, "a binary BVH to compare with cwbvh")
            .limit("optix", has_launched_rays, "OptiX follows rays of queues, on CUDA devices"),
        Is(Of::choice(
            "build", &S::build, {"auto", "fast", "good"},
            "how cwbvh is built: fast, by the device; good, by the CPU, in 25 to 700 times as long, for rays "
            "that are up to half as fast again; auto: fast on CUDA for scenes of a million triangles and more, or "
            "where the good one would take a fifth of the time that is given (--time); good in experiments "
            "and with deterministic=true")),
        Is(memory()),
        Is(Of::choice(
               "textures", &S::textures, {"device", "host", "pinned"},
               "where textures lie on CUDA: device; host: in the host's memory, and pages in use on the device as "
               "well; pinned: on the host alone"))
            .limit("host", on_cuda, "a CPU has no memory but the host's")
            .limit("pinned", on_cuda, "a CPU has no memory but the host's"),
    };
}

Setting light_picking() {
    return Setting(Of::choice("light_picking", &S::light_picking, {"table", "tree"},
                              "how next event estimation picks an emitter: by the table of the scene (option "
                              "--light-picking), or by a tree over the lights that knows the receiver (Conty Estevez "
                              "and Kulla 2018)"))
        .limit("tree", has_light_tree, "its kernels pick emitters by the table alone")
        .not_with_auto(
            "its pilot predicts for emitters picked by the table; render with the settings that it chooses "
            "and this one");
}

Setting selector() {
    return Setting(Of::choice("selector", &S::selector, {"image", "efficiency"},
                              "what bdpt.auto=true chooses for: the whole image, or numbers of connections for each "
                              "pixel too (efficiency-aware, Grittmann et al. 2022)"))
        .where(has_strategies, "there is nothing to choose")
        .only_with_auto();
}

Setting sampler() {
    return Setting(Of::choice("sampler", &S::sampler, {"independent", "sobol"},
                              "where the random numbers of subpaths come from: each by itself, or shuffled, "
                              "Owen-scrambled Sobol' points (Burley 2020), whose error is known from several seeds "
                              "alone"))
        .limit("sobol", has_sobol, "its kernels have independent numbers alone")
        .not_with_auto(
            "its pilot predicts for independent numbers; render with the settings that it chooses and this "
            "one")
        .image_attribute();
}

/// Strategies, their weights and their numbers.
std::vector<Setting> estimator_settings() {
    using Is = Setting;
    Setting groups = Is(strategies())
                         .where(has_strategies, "there are no strategies to choose from")
                         .not_with_auto(kAutoChooses)
                         .image_attribute()
                         .leaves_out();
    groups.shown = shown_strategies;
    return {
        Is(Of::choice("estimator", &S::estimator, {"naive", "nee", "mis"},
                      "hits of emitters alone, next event estimation wherever it finds the light, or both, weighted"))
            .where(has_estimators, "there is but one")
            .key_of_runs()
            .image_attribute()
            .leaves_out(),
        light_picking(),
        sampler(),
        Is(Of::choice("heuristic", &S::heuristic, {std::begin(Heuristics::kNames), std::end(Heuristics::kNames)},
                      "heuristic of multiple importance sampling"))
            .where(weighs, "no strategies are weighted by a heuristic")
            .image_attribute(),
        groups,
        Is(Of::number("technique_depth", &S::technique_depth, 0u, kMaxStrategyDepth,
                      "segments up to which images of single strategies are gathered; 0: none"))
            .where(gathers_strategies, "no images of single strategies are gathered")
            .not_with_auto("bdpt.auto=true may choose the path tracer, which gathers no images of single strategies; "
                           "render once without them and repeat with the settings that were chosen")
            .not_in_runs("the experiment: a run has the key 'techniques' for it"),
        Is(Of::flag("bdpt.auto", &S::automatic,
                    "a short pilot chooses strategies, variant and numbers, the path tracer among them"))
            .where(has_strategies, "there is nothing to choose")
            .leaves_out(),
        Is(Of::choice(
               "allow", &S::allow, {"unbiased", "consistent"},
               "what bdpt.auto=true may choose; consistent: merging (vcm) too, if a few samples of both show less "
               "variance in the same time than the best of the others"))
            .where(has_strategies, "there is nothing to choose")
            .only_with_auto()
            .leaves_out(),
        selector(),
        Is(Of::number("connections", &S::connections, 1u, kMaxCacheDraws, "light vertices that an eye vertex draws"))
            .where(draws_vertices, "no light vertices are drawn")
            .chosen_by_auto()
            .not_with_auto(kAutoChooses)
            .image_attribute(),
        Is(Of::choice("draws", &S::draws, {"auto", "coherent", "independent"},
                      "lanes of a warp draw light vertices that lie together (auto on CUDA), or each for itself"))
            .where(draws_together, "no light vertices are drawn, or as was learned")
            .chosen_by_auto()
            .limit("coherent", on_cuda, "lanes of a warp draw together"),
        Is(light_paths())
            .where(has_light_subpaths, "there are no light subpaths")
            .not_with_auto(kAutoChooses)
            .image_attribute(),
        Is(Of::number("cull", &S::cull, 0.0f, 1.0f,
                      "Russian roulette before shadow rays that would add less than this times what their path has "
                      "brought; 0: none"))
            .where(culls, "there are no shadow rays that may be left out"),
    };
}

/// The same image, made in another way.
std::vector<Setting> schedule_settings() {
    using Is = Setting;
    return {
        Is(Of::number("wave_size", &S::wave_size, 0u, 1u << 28, "paths in flight; 0: as many as pay")),
        Is(Of::choice("fuse", &S::fuse, {"auto", "none"},
                      "stages run as parts of others, as suits the backend, or each with queues")),
        Is(Of::flag("specialise", &S::specialise, "kernels hold only what the scene has")),
        Is(Of::flag("tail", &S::tail, "CUDA: the last subpaths of a wave take several bounces in one launch"))
            .where(on_cuda, "only a device has launches to save"),
        Is(Of::choice(
               "compaction", [](auto& s) -> auto& { return compaction(s); }, {"atomic", "select", "none"},
               "items are appended to queues; lie at the places of their paths and are listed by a scan; or "
               "without a list"))
            .where(compacts, "there are no queues of one item per path"),
        Is(Of::choice(
               "ordering", [](auto& s) -> auto& { return ordering(s); }, {"none", "material", "morton", "auto"},
               "hits are sorted by material, or rays by octant and Morton code; auto: by material on CUDA, for "
               "scenes with several types of BSDFs"))
            .limit("material", sorts, "there are no queues to sort")
            .limit("morton", sorts, "there are no queues to sort"),
        Is(Of::flag("graph", &S::graph, "CUDA: one graph per wave; false launches kernel by kernel, for profilers"))
            .where(on_cuda, "only a device has graphs of kernels"),
    };
}

/// General or of a variant. Null if there is none.
const Setting* find_setting(const std::string& key) {
    if (const Setting* general = find_general_setting(key)) return general;
    for (const Variant& v : variants())
        if (const Setting* own = v.find_own(key)) return own;
    return nullptr;
}

[[noreturn]] void refuse_key(const std::string& key) {
    Names known;
    for (const Setting& s : general_settings()) known.push_back(s.what.key);
    for (const Variant& v : variants())
        for (const Setting& s : v.own) known.push_back(s.what.key);
    const std::string near = nearest_name(known, key);
    throw Error(ExitCode::usage,
                fmt::format("unknown setting '{}': {}", key,
                            near.empty() ? "`ambilux help settings` lists them" : fmt::format("is '{}' meant?", near)));
}

}  // namespace

std::string text_of(const SettingValue& value) {
    return std::visit([](const auto& v) { return fmt::format("{}", v); }, value);
}

const std::vector<Setting>& general_settings() {
    static const std::vector<Setting> all = [] {
        std::vector<Setting> list;
        for (const auto& part : {main_settings(), estimator_settings(), schedule_settings()})
            list.insert(list.end(), part.begin(), part.end());
        return list;
    }();
    return all;
}

const Setting* find_general_setting(const std::string& key) {
    const auto& all = general_settings();
    const auto at = std::find_if(all.begin(), all.end(), [&](const Setting& s) { return s.what.key == key; });
    return at == all.end() ? nullptr : &*at;
}

void apply_setting(RenderSettings& settings, const std::string& key, const std::string& value) {
    const Setting* setting = find_setting(key);
    if (!setting) refuse_key(key);
    setting->what.set(settings, value);
}

std::string setting_text(const RenderSettings& settings, const std::string& key) {
    const Setting* setting = find_setting(key);
    if (!setting) refuse_key(key);
    return setting->text(settings);
}

template <>
Choice<Backend>::Choice(const std::string& name) : value_(Backend::automatic) {
    RenderSettings parsed;
    apply_setting(parsed, "backend", name);
    value_ = parsed.backend;
}

template <>
Choice<AccelKind>::Choice(const std::string& name) : value_(AccelKind::automatic) {
    RenderSettings parsed;
    apply_setting(parsed, "accel", name);
    value_ = parsed.accel;
}

}  // namespace ambilux
