#include "integrators/reachability.h"

#include <fmt/format.h>

#include <algorithm>

#include "integrators/registry.h"
#include "transport/mis/strategy.h"

namespace ambilux {
namespace {

/// Two sets of groups differ in a word of at most this many segments, if they differ at all: Ld S D D S E is the
/// longest that is the shortest of its kind.
constexpr int kLongestWord = 5;

constexpr uint32_t kDeltaBsdfs = BsdfModels::mask([](auto m) { return decltype(m)::type::delta; });
constexpr uint32_t kSmoothBsdfs = BsdfModels::mask([](auto m) { return decltype(m)::type::smooth; });

/// What rays and next event estimation find of an emitter: both, the latter only, nothing.
enum class Origin { extent, delta, beam };

constexpr uint32_t emitters_of(Origin origin) {
    return origin == Origin::extent  ? ~detail::kDeltaEmitters
           : origin == Origin::delta ? detail::kDeltaEmitters & ~detail::kBeamEmitters
                                     : detail::kBeamEmitters;
}

/// A path of `segments`: bit i - 1 of `delta` says that its vertex i, counted from the emitter, is passed by a delta
/// lobe.
struct Word {
    int segments;
    uint32_t delta;
    Origin origin;

    bool connectable(int i) const { return !(delta >> (i - 1) & 1u); }
    std::string text() const {
        std::string s = origin == Origin::extent ? "L" : origin == Origin::delta ? "Ld" : "Lb";
        for (int i = 1; i < segments; ++i) s += connectable(i) ? " D" : " S";
        return s + " E";
    }
};

/// Strategies that are joined at the first vertex, seen from the camera, that no delta lobe passes (kJoinedAtFirst).
bool finds_at_first(uint32_t strategies, const Word& w) {
    int first = w.segments - 1;
    while (first > 0 && !w.connectable(first)) --first;
    if (first == 0) return w.origin == Origin::extent && (strategies & kHitStrategies);
    if (first == 1) return w.origin != Origin::beam && (strategies & kNextEventStrategies);
    return (strategies & kConnectionStrategies) && w.connectable(first - 1);
}

bool finds(uint32_t strategies, const Word& w) {
    if (strategies & kJoinedAtFirst) return finds_at_first(strategies, w);
    if (w.origin == Origin::extent && (strategies & kHitStrategies)) return true;
    if (w.segments == 1) return w.origin == Origin::extent && (strategies & kLightStrategies);
    if ((strategies & kNextEventStrategies) && w.origin != Origin::beam && w.connectable(1)) return true;
    if ((strategies & kLightStrategies) && w.connectable(w.segments - 1)) return true;
    for (int i = 1; i < w.segments; ++i)
        if ((strategies & kMergeStrategies) && w.connectable(i)) return true;
    for (int i = 1; i + 1 < w.segments; ++i)
        if ((strategies & kConnectionStrategies) && w.connectable(i) && w.connectable(i + 1)) return true;
    return false;
}

/// True if the one strategy that is on for paths of this length finds this one.
bool finds(const SingleStrategies& singles, const Word& w) {
    const int s = singles.s[w.segments];
    if (s == SingleStrategies::kNone) return false;
    if (s == 0) return w.origin == Origin::extent;
    if (s == 1 && w.origin == Origin::beam) return false;
    // Vertex s - 1 is joined to vertex s; the emitter is vertex 0, the camera vertex w.segments.
    return (s == 1 || w.connectable(s - 1)) && (s == w.segments || w.connectable(s));
}

/// The shortest word of the scene for which `lost` is true.
template <class Lost>
std::string shortest(const Features& f, int max_depth, Lost lost) {
    const int longest = max_depth < 0 ? kLongestWord : std::min(max_depth, kLongestWord);
    for (int k = 1; k <= longest; ++k)
        for (uint32_t delta = 0; delta < 1u << (k - 1); ++delta) {
            const uint32_t all = (1u << (k - 1)) - 1;
            if ((delta != 0 && !(f.bsdfs & kDeltaBsdfs) && !f.coats) || (delta != all && !(f.bsdfs & kSmoothBsdfs)))
                continue;
            for (const Origin origin : {Origin::extent, Origin::delta, Origin::beam}) {
                // No camera sees a delta emitter.
                if (k == 1 && origin != Origin::extent) continue;
                const Word w = {k, delta, origin};
                if ((f.emitters & emitters_of(origin)) && lost(w)) return w.text();
            }
        }
    return "";
}

}  // namespace

std::string unreachable_path(const Features& features, uint32_t strategies, uint32_t reference, int max_depth) {
    return shortest(features, max_depth, [&](const Word& w) { return finds(reference, w) && !finds(strategies, w); });
}

std::string unreachable_path(const Features& features, uint32_t strategies, int max_depth) {
    return shortest(features, max_depth, [&](const Word& w) { return !finds(strategies, w); });
}

uint32_t sampled_strategies(const RenderSettings& settings) {
    const Variant* const variant = find_variant(settings.integrator, settings.variant);
    return variant && variant->strategies ? variant->strategies(settings) : 0;
}

namespace {

std::string lacking(const std::string& path, const std::string& why) {
    return fmt::format(
        "the image lacks light of paths such as {} (L: emitter; Ld: point, spot, directional or hiddenarea; "
        "Lb: collimated or directionalarea; S: delta lobe, D: another one; E: camera), which {}",
        path, why);
}

}  // namespace

std::string missing_light(const Features& features, const RenderSettings& settings) {
    if (settings.automatic) return "";
    const Variant* const variant = find_variant(settings.integrator, settings.variant);
    if (settings.singles.on && variant && variant->traits.strategies) {
        const std::string lost = shortest(features, settings.max_depth, [&](const Word& w) {
            return finds(uint32_t(kAllStrategies), w) && !finds(settings.singles, w);
        });
        return lost.empty() ? "" : lacking(lost, "these single strategies do not find");
    }
    const uint32_t strategies = sampled_strategies(settings);
    if (strategies == 0) return "";  // an integrator that is no estimator of all light
    const std::pair<uint32_t, const char*> others[] = {
        {kAllStrategies, "these strategies do not find; integrator bdpt finds more"},
        {kAllStrategies | kMergeStrategies, "these strategies do not find; integrator vcm does, by merging"}};
    for (const auto& [reference, why] : others)
        if (const std::string lost = unreachable_path(features, strategies, reference, settings.max_depth);
            !lost.empty())
            return lacking(lost, why);
    const std::string lost = unreachable_path(features, strategies, settings.max_depth);
    return lost.empty() ? "" : lacking(lost, "no strategy finds");
}

}  // namespace ambilux
