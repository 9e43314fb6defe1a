// s = 0: an eye subpath meets an emitter, or leaves the scene towards the environment.
#pragma once

#include "transport/emitter.h"
#include "transport/subpath/rules.h"

namespace ambilux {

namespace detail {

template <class Mis>
AMBILUX_HD bool emitted(const Rules<Mis>& rules, const Subpath<Mis>& path, Rgb radiance,
                        const typename Mis::Ratio& ratio, Candidate<Mis>& c) {
    c.value = path.throughput * radiance;
    c.ratio = rules.counted(ratio);
    c.strategy = Strategy::make(0, path.depth + 1);
    return !is_zero(c.value);
}

}  // namespace detail

/// Light that an area emitter sends from `point` along the ray of `path`. False if there is none that counts.
template <Features F, class Mis>
AMBILUX_HD bool emission(const SceneView& scene, const Rules<Mis>& rules, const Subpath<Mis>& path,
                         const SurfacePoint& point, Candidate<Mis>& c) {
    const uint32_t emitter = scene.shapes[point.shape].emitter;
    if (emitter == kNone || !rules.count_hits || !rules.sees_emitters(path.depth) || !rules.wants(0, path.depth + 1))
        return false;
    const Rgb radiance = emitted_radiance<F>(scene, emitter, point, -path.direction);
    typename Mis::Ratio ratio;
    return !is_zero(radiance) &&
           rules.mis.template hit_ratio<F>(scene, rules.lights, path, path.sums, emitter, point, ratio) &&
           detail::emitted(rules, path, radiance, ratio, c);
}

/// Light that the environment sends along the ray of `path`, which met nothing. False if there is none that counts.
template <Features F, class Mis>
AMBILUX_HD bool escape(const SceneView& scene, const Rules<Mis>& rules, const Subpath<Mis>& path, Candidate<Mis>& c) {
    if constexpr (F.has_environment()) {
        if (!rules.counts_environment(path.depth) || !rules.sees_emitters(path.depth) ||
            !rules.wants(0, path.depth + 1))
            return false;
        typename Mis::Ratio ratio;
        return rules.mis.template escape_ratio<F>(scene, rules.lights, path, path.sums, ratio) &&
               detail::emitted(rules, path, environment_radiance<F>(scene, path.direction), ratio, c);
    }
    return false;
}

}  // namespace ambilux
