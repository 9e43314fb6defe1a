// A model of weights with a third sum, as other heuristics have one. The sum follows from the other two, so that
// wherever ratios are asked for, it tells whether it came along; weights are those of BidirectionalMis then, else 0.
#pragma once

#include "transport/mis/bidirectional.h"

namespace ambilux {

struct ThirdSumMis : BidirectionalMis {
    struct Sums : MisSums {
        float third;
    };

    static Sums with_third(const MisSums& s) { return {s, third_of(s)}; }
    static float third_of(const MisSums& s) { return 3.0f * s.dvcm - s.dvc + 1.0f; }
    /// `ratio`, unless the third sum of `s` is not the one that belongs to the others.
    static float checked(const Sums& s, float ratio) { return s.third == third_of(s) ? ratio : kInfinity; }

    template <Features F>
    void start_eye(const SceneView& scene, Vec3f d, Sums& sums, SubpathStart& start) const {
        MisSums two;
        BidirectionalMis::start_eye<F>(scene, d, two, start);
        sums = with_third(two);
    }
    template <Features F, class Path>
    Sums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, const Sums& sums,
                 const SurfacePoint& point) const {
        return with_third(BidirectionalMis::sums_at<F>(scene, lights, side, path, sums, point));
    }
    Sums sums_after_scatter(const Sums& s, bool first, bool delta, float pdf_forward_sa, float pdf_reverse_sa,
                            float cos_out) const {
        return with_third(
            BidirectionalMis::sums_after_scatter(s, first, delta, pdf_forward_sa, pdf_reverse_sa, cos_out));
    }
    template <Features F, class Path>
    bool hit_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray, uint32_t emitter,
                   const SurfacePoint& light, float& ratio) const {
        const bool counts = BidirectionalMis::hit_ratio<F>(scene, lights, path, ray, emitter, light, ratio);
        ratio = checked(ray, ratio);
        return counts;
    }
    template <Features F, class Path>
    bool escape_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                      float& ratio) const {
        const bool counts = BidirectionalMis::escape_ratio<F>(scene, lights, path, ray, ratio);
        ratio = checked(ray, ratio);
        return counts;
    }
    template <Features F>
    float next_event_ratio(const SceneView& scene, float over_power, const Sums& z, bool first,
                           const EmitterSample& light, const BsdfValue& f, float cos_z) const {
        return checked(z, BidirectionalMis::next_event_ratio<F>(scene, over_power, z, first, light, f, cos_z));
    }
    float connection_ratio(const Sums& y, bool y_first, const Sums& z, bool z_first,
                           const ConnectionDensities& p) const {
        return checked(y, checked(z, BidirectionalMis::connection_ratio(y, y_first, z, z_first, p)));
    }
    template <Features F>
    float camera_ratio(const SceneView& scene, const Sums& y, bool first, const CameraConnection& c, float cos_y,
                       float pdf_reverse_sa) const {
        return checked(y, BidirectionalMis::camera_ratio<F>(scene, y, first, c, cos_y, pdf_reverse_sa));
    }
};

}  // namespace ambilux
