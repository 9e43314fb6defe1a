// Weights where next event estimation picks lights by a tree: a ray knows the normal where it began, as the probability
// depends on it. All else is that of `Base`.
#pragma once

#include <type_traits>

#include "models/features.h"
#include "transport/emitter/light_tree.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

template <class Base>
struct ByTree : Base {
    using Lights = LightsByTree;

    struct Sums : Base::Sums {
        /// A vertex has its normal: it keeps what those of `Base` keep.
        static constexpr uint32_t kVertexWords = [] {
            if constexpr (requires { Base::Sums::kVertexWords; })
                return Base::Sums::kVertexWords;
            else
                return uint32_t(sizeof(typename Base::Sums) / sizeof(float));
        }();
        CoarseNormal normal;

        AMBILUX_HD Vec3f receiver_normal() const { return normal.unpack(); }
    };

    template <Features F>
    AMBILUX_HD void start_eye(const SceneView& scene, Vec3f d, Sums& sums, typename Base::Start& start) const {
        typename Base::Sums of_base;
        Base::template start_eye<F>(scene, d, of_base, start);
        sums = {of_base, CoarseNormal::pack({0.0f, 0.0f, 0.0f})};
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, Sums sums,
                            const SurfacePoint& point) const {
        return {Base::template sums_at<F>(scene, lights, side, path, sums, point), CoarseNormal::pack(point.ng)};
    }
    AMBILUX_HD Sums sums_after_scatter(Sums s, bool first, bool delta, float pdf_forward_sa, float pdf_reverse_sa,
                                       float cos_out) const {
        return {Base::sums_after_scatter(s, first, delta, pdf_forward_sa, pdf_reverse_sa, cos_out), s.normal};
    }
};

}  // namespace ambilux
