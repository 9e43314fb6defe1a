// Multiple importance sampling of the path tracer: hits of emitters against next event estimation at the vertex before.
#pragma once

#include "transport/emitter.h"
#include "transport/mis/estimator.h"
#include "transport/mis/heuristic.h"
#include "transport/subpath/directions.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

struct UnidirectionalMis {
    /// Density of the ray's direction by BSDF sampling; after a delta a probability.
    struct Sums {
        static constexpr uint32_t kVertexWords = 0;  ///< nothing is asked of it at a vertex
        float pdf_sa;
    };
    struct Start {};
    using Directions = BsdfDirections;
    using Lights = LightsByPower;
    using Numbers = RandomNumbers;
    using Ratio = float;
    static constexpr bool kBidirectional = false;

    Estimator estimator;
    MisHeuristic heuristic;
    bool next_event;  ///< emitters are sampled

    template <Features>
    AMBILUX_HD void start_eye(const SceneView&, Vec3f, Sums& sums, Start&) const {
        sums = {0.0f};
    }

    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView&, const Lights&, Side, const Path&, Sums sums, const SurfacePoint&) const {
        return sums;
    }
    AMBILUX_HD Sums sums_after_scatter(Sums, bool, bool, float pdf_forward_sa, float, float) const {
        return {pdf_forward_sa};
    }

    /// `pdf_other_sa`: of next event estimation for what a ray met, over the chance that rays meet it. False if that
    /// finds it alone.
    AMBILUX_HD bool ratio_to(Sums ray, float pdf_other_sa, float& ratio) const {
        if (estimator == Estimator::nee && pdf_other_sa > 0.0f) return false;
        ratio = estimator == Estimator::mis ? heuristic_term(heuristic, pdf_other_sa / ray.pdf_sa) : 0.0f;
        if (pdf_other_sa == 0.0f) ratio = 0.0f;
        return true;
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD bool hit_ratio(const SceneView& scene, const Lights& lights, const Path& path, Sums ray,
                              uint32_t emitter, const SurfacePoint& light, float& ratio) const {
        float pdf_other_sa = 0.0f;
        if (next_event && !path.delta) {
            pdf_other_sa = pdf_emitter_direct<F>(scene, emitter, path.origin, path.direction, light) *
                           lights.over_power(scene, receiver_of_ray(path.origin, path.sums), emitter, light.prim);
            if constexpr (F.opacity) pdf_other_sa /= hit_opacity<F>(scene, emitter, light);
        }
        return ratio_to(ray, pdf_other_sa, ratio);
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD bool escape_ratio(const SceneView& scene, const Lights& lights, const Path& path, Sums ray,
                                 float& ratio) const {
        float pdf_other_sa = 0.0f;
        if (next_event && !path.delta)
            pdf_other_sa = pdf_environment_direct<F>(scene, path.direction) *
                           lights.over_power(scene, receiver_of_ray(path.origin, path.sums), scene.environment, kNone);
        return ratio_to(ray, pdf_other_sa, ratio);
    }
    template <Features F>
    AMBILUX_HD float next_event_ratio([[maybe_unused]] const SceneView& scene, float, Sums, bool,
                                      const EmitterSample& light, const BsdfValue& f, float) const {
        // Only BSDF sampling and a hit could find this light too.
        const bool other = estimator == Estimator::mis && !light.delta;
        float pdf_hit_sa = f.pdf_sa;
        if constexpr (F.opacity) pdf_hit_sa *= sample_opacity(scene, light);
        return other ? heuristic_term(heuristic, pdf_hit_sa / light.pdf_sa) : 0.0f;
    }
    /// The last segment brings emission only, which next event estimation leaves to hits after a delta.
    AMBILUX_HD bool counts_last_segment(bool delta) const { return estimator != Estimator::nee || delta; }
};

}  // namespace ambilux
