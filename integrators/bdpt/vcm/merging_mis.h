// Multiple importance sampling over the strategies of bidirectional path tracing and vertex merging (Georgiev et al.
// 2012, "Light Transport Simulation with Vertex Connection and Merging"; "Implementing Vertex Connection and Merging",
// technical report). docs/theory.md, "Merging", has the derivation.
//
// A vertex of the path where both subpaths end within a radius r is one strategy more: its density is that of both
// subpaths, that vertex counted twice, times eta = pi r^2 N for N light subpaths. All such terms are proportional to
// eta. So a subpath carries their sum without it, as a third number, and eta is applied where a weight is asked for. It
// is that of the eye subpath, whose first vertex may decide its radius.
#pragma once

#include "integrators/variant_traits.h"
#include "transport/mis/bidirectional.h"
#include "transport/subpath/directions.h"

namespace ambilux {

/// What merging does in the iteration at work.
struct MergeNow {
    float radius;
    float eta;  ///< expected number of light subpaths of the iteration in a disk of that radius, at density 1 per area
};

/// `dvm`: as dvc, of the merges behind this vertex, over eta. Behind the first vertex of a subpath there is none: there
/// the word says whether a merge at that vertex itself counts, 1 or 0.
struct MergingSums {
    static constexpr uint32_t kFirstRayWords = 3;
    static constexpr uint32_t kLightWords = 3;

    float dvcm, dvc, dvm;
    float area;  ///< of an eye subpath: of the disk within which it merges, over that of MergeNow::radius
};

/// Radius of a disk across a camera ray that has the area of a pixel's footprint at `distance`.
template <Features F>
AMBILUX_HD float footprint_radius(const Sensor& sensor, float cos_camera, float distance) {
    const float pdf = BidirectionalMis::camera_pdf<F>(sensor, cos_camera);
    return (camera_delta_direction(sensor) ? 1.0f : distance) / sqrtf(kPi * pdf);
}

/// Of eye subpaths that end where they would leave a vertex by another lobe than a delta (merging_directions.h).
struct MergingDirections {
    bool deltas_only = false;

    template <Features F, class Mis>
    AMBILUX_HD bool sample(const Vertex<Mis>& v, Vec3f u, TransportMode mode, BsdfSample& s) const;
    template <Features F, class Mis>
    AMBILUX_HD static BsdfValue evaluate(const Vertex<Mis>& v, Vec3f wo, TransportMode mode);
};

struct MergingMis : BidirectionalMis {
    using Sums = MergingSums;
    using Directions = MergingDirections;

    const MergeNow* now = nullptr;  ///< of the wave
    bool merges_first = true;       ///< eye subpaths merge at their first vertex
    Merges merges = Merges::beside;
    float largest_footprint = 0.0f;  ///< of those where the radius is less for a smaller one; 0: it is the same for all
    float least_area = 1.0f;         ///< MergingSums::area, at least

    AMBILUX_HD float eta(const Sums& eye) const { return now->eta * eye.area; }
    AMBILUX_HD float radius(const Sums& eye) const { return now->radius * sqrtf(eye.area); }
    /// MergingSums::area of an eye subpath whose first vertex is at `distance` from the camera.
    template <Features F>
    AMBILUX_HD float area(const Sensor& sensor, float cos_camera, float distance) const {
        if (!(largest_footprint > 0.0f)) return 1.0f;
        const float area = sqr(footprint_radius<F>(sensor, cos_camera, distance) / largest_footprint);
        return fminf(fmaxf(area, least_area), 1.0f);
    }
    AMBILUX_HD bool beside() const { return merges == Merges::beside; }
    /// All other strategies find paths that no merge does.
    AMBILUX_HD bool competes() const { return merges != Merges::first; }

    template <Features F>
    AMBILUX_HD void start_eye(const SceneView& scene, Vec3f d, Sums& sums, SubpathStart& start) const {
        MisSums two;
        BidirectionalMis::start_eye<F>(scene, d, two, start);
        sums = {two.dvcm, two.dvc, 0.0f, 1.0f};
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, const Sums& sums,
                            const SurfacePoint& point) const {
        const MisSums s = BidirectionalMis::sums_at<F>(scene, lights, side, path, {sums.dvcm, sums.dvc}, point);
        if (path.depth == 1) {
            const float merge = competes() && (side == Side::light || merges_first) ? 1.0f : 0.0f;
            if (side == Side::light) return beside() ? Sums{s.dvcm, s.dvc, merge, 1.0f} : Sums{0.0f, 0.0f, merge, 1.0f};
            const float distance = length(point.p - path.origin) + path.start.camera_distance;
            return {s.dvcm, s.dvc, merge,
                    area<F>(scene.sensor, camera_cosine<F>(scene.sensor, path.direction), distance)};
        }
        return {s.dvcm, s.dvc, sums.dvm / fabsf(dot(point.ng, path.direction)), sums.area};
    }
    AMBILUX_HD Sums sums_after_scatter(const Sums& s, bool first, bool delta, float pdf_forward_sa,
                                       float pdf_reverse_sa, float cos_out) const {
        const MisSums two = BidirectionalMis::sums_after_scatter({s.dvcm, s.dvc}, first, delta, pdf_forward_sa,
                                                                 pdf_reverse_sa, cos_out);
        const float behind = first ? 0.0f : s.dvm * pdf_reverse_sa;
        const float here = delta || !competes() ? behind : norm(behind, first ? s.dvm : 1.0f);
        return {two.dvcm, two.dvc, cos_out / pdf_forward_sa * here, s.area};
    }

    // ---- ratios ----

    /// dvc with the merges behind this vertex.
    AMBILUX_HD float with_merges(const Sums& s, bool first, float eta) const {
        return first ? s.dvc : norm(s.dvc, eta * s.dvm);
    }
    /// Sums for the ratios of BidirectionalMis, to be taken as those of a first vertex, whose dvcm has all factors:
    /// with the merge at this vertex itself, if that counts.
    AMBILUX_HD MisSums seen(const Sums& s, bool first, bool merge_here, float eta) const {
        const float ends = connection_dvcm({s.dvcm, s.dvc}, first);
        const float here = !merge_here ? 0.0f : first ? eta * s.dvm : eta;
        return {norm(ends, here), with_merges(s, first, eta)};
    }
    /// Merges find all paths but those of deltas, where they do not compete with other strategies for them: the ray of
    /// such an eye subpath has no merge behind it.
    AMBILUX_HD static bool by_deltas_alone(const Sums& ray, float& ratio) {
        ratio = 0.0f;
        return ray.dvm == 0.0f;
    }
    /// Sums of a ray that left a vertex.
    AMBILUX_HD MisSums of_ray(const Sums& s) const { return {s.dvcm, norm(s.dvc, eta(s) * s.dvm)}; }

    template <Features F, class Path, class Lights>
    AMBILUX_HD bool hit_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                              uint32_t emitter, const SurfacePoint& light, float& ratio) const {
        if (!beside()) return by_deltas_alone(ray, ratio);
        return BidirectionalMis::hit_ratio<F>(scene, lights, path, of_ray(ray), emitter, light, ratio);
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD bool escape_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                                 float& ratio) const {
        if (!beside()) return by_deltas_alone(ray, ratio);
        return BidirectionalMis::escape_ratio<F>(scene, lights, path, of_ray(ray), ratio);
    }
    template <Features F>
    AMBILUX_HD float next_event_ratio(const SceneView& scene, float over_power, const Sums& z, bool first,
                                      const EmitterSample& light, const BsdfValue& f, float cos_z) const {
        if (!competes()) return 0.0f;
        return BidirectionalMis::next_event_ratio<F>(scene, over_power, seen(z, first, true, eta(z)), true, light, f,
                                                     cos_z);
    }
    AMBILUX_HD float connection_ratio(const Sums& y, bool y_first, const Sums& z, bool z_first,
                                      const ConnectionDensities& p) const {
        return BidirectionalMis::connection_ratio(seen(y, y_first, true, eta(z)), true, seen(z, z_first, true, eta(z)),
                                                  true, p);
    }
    /// The vertex is the first of the eye subpaths that would find it.
    template <Features F>
    AMBILUX_HD float camera_ratio(const SceneView& scene, const Sums& y, bool first, const CameraConnection& c,
                                  float cos_y, float pdf_reverse_sa) const {
        const float eta = now->eta * area<F>(scene.sensor, c.cos_camera, c.camera_distance);
        return BidirectionalMis::camera_ratio<F>(scene, seen(y, first, merges_first, eta), true, c, cos_y,
                                                 pdf_reverse_sa);
    }
    /// A merge of light vertex `y` with eye vertex `z`: `f` at z, for light that arrives as it did at y.
    AMBILUX_HD float merge_ratio(const Sums& y, bool y_first, const Sums& z, bool z_first, const BsdfValue& f) const {
        const float n = eta(z);
        const float light = norm(connection_dvcm({y.dvcm, y.dvc}, y_first), with_merges(y, y_first, n) * f.pdf_sa);
        const float eye =
            norm(connection_dvcm({z.dvcm, z.dvc}, z_first), with_merges(z, z_first, n) * f.pdf_reverse_sa);
        return term(light / n) + term(eye / n);
    }
};

}  // namespace ambilux
