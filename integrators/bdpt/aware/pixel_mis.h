// Multiple importance sampling over the strategies of bidirectional path tracing where the number of connections of an
// eye vertex depends on the pixel (Grittmann et al. 2022, "Efficiency-aware multiple importance sampling for
// bidirectional rendering algorithms"; docs/theory.md, "Connections by pixel"). Light subpaths do not know which pixel
// they will serve. So the sums of a subpath keep connections apart, as if there were one of each strategy, and their
// number is applied where a weight is asked for.
#pragma once

#include "integrators/bdpt/aware/counts.h"
#include "transport/mis/bidirectional.h"

namespace ambilux {

/// `dvc`: of the strategies behind this vertex that are no connections. `dvk`: of the connections behind it, over their
/// number; none behind the first vertex of a subpath.
struct PixelSums {
    static constexpr uint32_t kFirstRayWords = 3;
    static constexpr uint32_t kLightWords = 3;

    float dvcm, dvc, dvk;
    float draws;  ///< of an eye subpath: PixelCounts
};

struct PixelMis : BidirectionalMis {
    using Sums = PixelSums;

    PixelCounts counts = {};
    float per_draw = 0.0f;  ///< expected samples of each strategy of connections that a draw stands for

    PixelMis() = default;
    /// Its number of connections must be 0: they are no part of the sums.
    AMBILUX_HD explicit PixelMis(BidirectionalMis mis) : BidirectionalMis(mis) { connections = 0.0f; }

    AMBILUX_HD float density(float draws) const { return masked(kConnectionStrategies, draws * per_draw); }

    template <Features F>
    AMBILUX_HD void start_eye(const SceneView& scene, Vec3f d, Sums& sums, SubpathStart& start) const {
        MisSums two;
        BidirectionalMis::start_eye<F>(scene, d, two, start);
        sums = {two.dvcm, two.dvc, 0.0f, 0.0f};
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, const Sums& sums,
                            const SurfacePoint& point) const {
        const MisSums s = BidirectionalMis::sums_at<F>(scene, lights, side, path, {sums.dvcm, sums.dvc}, point);
        if (path.depth > 1) return {s.dvcm, s.dvc, sums.dvk / fabsf(dot(point.ng, path.direction)), sums.draws};
        const Sensor& sensor = scene.sensor;
        return {s.dvcm, s.dvc, 0.0f,
                side == Side::eye ? float(counts.at(sensor, film_position<F>(sensor, path, point.p))) : 0.0f};
    }
    AMBILUX_HD Sums sums_after_scatter(const Sums& s, bool first, bool delta, float pdf_forward_sa,
                                       float pdf_reverse_sa, float cos_out) const {
        const MisSums two = BidirectionalMis::sums_after_scatter({s.dvcm, s.dvc}, first, delta, pdf_forward_sa,
                                                                 pdf_reverse_sa, cos_out);
        const float behind = s.dvk * pdf_reverse_sa;
        return {two.dvcm, two.dvc, cos_out / pdf_forward_sa * (delta || first ? behind : norm(behind, s.dvcm)),
                s.draws};
    }

    // ---- ratios, with n connections ----

    /// Sums for the ratios of BidirectionalMis, to be taken as those of a first vertex, whose dvcm has all factors.
    AMBILUX_HD MisSums seen(const Sums& s, bool first, float n) const {
        return {first ? s.dvcm : n * s.dvcm, norm(s.dvc, n * s.dvk)};
    }
    /// Sums of a ray of an eye subpath.
    AMBILUX_HD MisSums of_ray(const Sums& s) const { return seen(s, true, density(s.draws)); }

    template <Features F, class Path, class Lights>
    AMBILUX_HD bool hit_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                              uint32_t emitter, const SurfacePoint& light, float& ratio) const {
        return BidirectionalMis::hit_ratio<F>(scene, lights, path, of_ray(ray), emitter, light, ratio);
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD bool escape_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                                 float& ratio) const {
        return BidirectionalMis::escape_ratio<F>(scene, lights, path, of_ray(ray), ratio);
    }
    template <Features F>
    AMBILUX_HD float next_event_ratio(const SceneView& scene, float over_power, const Sums& z, bool first,
                                      const EmitterSample& light, const BsdfValue& f, float cos_z) const {
        return BidirectionalMis::next_event_ratio<F>(scene, over_power, seen(z, first, density(z.draws)), true, light,
                                                     f, cos_z);
    }
    AMBILUX_HD float connection_ratio(const Sums& y, bool y_first, const Sums& z, bool z_first,
                                      const ConnectionDensities& p) const {
        const float n = density(z.draws);
        return (term(ratio_behind(seen(y, y_first, n), true, p.y_area, p.y_reverse_sa)) +
                term(ratio_behind(seen(z, z_first, n), true, p.z_area, p.z_reverse_sa))) /
               term(n);
    }
    /// The pixel is that where the camera sees the vertex.
    template <Features F>
    AMBILUX_HD float camera_ratio(const SceneView& scene, const Sums& y, bool first, const CameraConnection& c,
                                  float cos_y, float pdf_reverse_sa) const {
        const float n = density(float(counts.at(scene.sensor, c.film_position)));
        return BidirectionalMis::camera_ratio<F>(scene, seen(y, first, n), true, c, cos_y, pdf_reverse_sa);
    }
};

}  // namespace ambilux
