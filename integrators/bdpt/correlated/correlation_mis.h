// Weights of vertex connection and merging that know what merges have in common (Grittmann, Georgiev and Slusallek
// 2021, "Correlation-Aware Multiple Importance Sampling for Bidirectional Rendering Algorithms"). docs/theory.md,
// "Correlated merges", has the formulas.
//
// Merges at one vertex share the eye subpath up to there: many of them are no more than one sample where that is what
// varies. So the density of a merge is scaled by a factor that compares how probably another eye subpath, and another
// light subpath, comes by nearby. It is a product over densities from both ends, each bounded by 1, and the area that
// they are multiplied by is known to eye subpaths alone: no sum can carry it. Subpaths carry the densities of their
// vertices instead, there and back, and a weight goes through those of the whole path. Strategies that do not merge
// have the sums of BidirectionalMis.
#pragma once

#include "integrators/bdpt/vcm/merging_mis.h"

namespace ambilux {

/// Longest paths whose merges are scaled, in vertices on surfaces. All strategies of a path agree on their number;
/// longer ones have the weights of MergingMis.
constexpr uint32_t kMostCorrelated = 8;

/// What is nearby lies within this times the distance from the camera to the first vertex of the eye subpath: the
/// tangent of a degree.
constexpr float kNearby = 0.0174550649f;

/// Densities along one subpath. Those behind deltas are coefficients, whose ratio is that of sums_after_scatter.
struct CorrelationSums {
    MergingSums merging;  ///< of paths that are longer
    uint32_t vertices;    ///< how many there are (kDepthBits), and above, by vertex, where the subpath left by a delta
    float start;       ///< eye: the area that is nearby; light: density of the vertex on an area emitter, or infinite
    float pending[2];  ///< of a ray: density of its direction per solid angle, and its cosine where it left. Of a
                       ///< vertex: of the vertex before it per area, over that of the direction to it
    float forward[kMostCorrelated];      ///< of vertices, per area, as they were sampled
    float reverse[kMostCorrelated - 1];  ///< from the other end

    AMBILUX_HD uint32_t count() const { return vertices & kMaxDepth; }
    AMBILUX_HD uint32_t deltas() const { return vertices >> kDepthBits; }
    AMBILUX_HD MisSums two() const { return {merging.dvcm, merging.dvc}; }

    AMBILUX_HD void add(float density) {
        if (count() < kMostCorrelated) forward[count()] = density;
        ++vertices;
    }
    /// With the density of the vertex before the last: `pdf_reverse_sa` is that of the direction to it.
    AMBILUX_HD CorrelationSums with_reverse(float pdf_reverse_sa) const {
        CorrelationSums s = *this;
        if (count() >= 2 && count() <= kMostCorrelated) s.reverse[count() - 2] = pdf_reverse_sa * pending[0];
        return s;
    }
};
static_assert(kDepthBits + kMostCorrelated <= 32);

/// Both densities of the vertices of a whole path, from the camera on.
struct CorrelatedPath {
    uint32_t size = 0;
    uint32_t deltas = 0;
    float nearby;   ///< area
    float emitter;  ///< CorrelationSums::start of light subpaths
    float eye[kMostCorrelated], light[kMostCorrelated];

    /// `last`: density of the last vertex by light subpaths.
    AMBILUX_HD void add_eye(const CorrelationSums& z, float last) {
        size = z.count();
        deltas = z.deltas();
        nearby = z.start;
        for (uint32_t i = 0; i < size; ++i) {
            eye[i] = z.forward[i];
            light[i] = i + 1 < size ? z.reverse[i] : last;
        }
    }
    /// Behind those of the eye subpath. `last`: density of the last vertex by eye subpaths; it is there already if the
    /// subpaths are `merged`.
    AMBILUX_HD void add_light(const CorrelationSums& y, float last, bool merged = false) {
        const uint32_t count = y.count();
        size += merged ? count - 1 : count;
        emitter = y.start;
        for (uint32_t i = 0; i < count; ++i) {
            const uint32_t at = size - 1 - i;
            if (y.deltas() >> i & 1) deltas |= 1u << at;
            light[at] = y.forward[i];
            if (i + 1 < count)
                eye[at] = y.reverse[i];
            else if (!merged)
                eye[at] = last;
        }
    }

    /// Chance that a subpath has a vertex nearby: what a delta leads to follows from the vertex before.
    AMBILUX_HD float chance(float density, bool by_delta) const {
        return by_delta || !(density * nearby < 1.0f) ? 1.0f : density * nearby;
    }
    /// Factors of the merges at all vertices, at least `least`. Products stay floats.
    AMBILUX_HD void factors(float least, float (&factor)[kMostCorrelated]) const {
        constexpr float kLeastProduct = 1e-30f;
        float by_light = chance(emitter, false), by_eye = 1.0f;
        for (uint32_t i = size; i-- > 0;) {
            by_light = max(by_light * chance(light[i], i + 1 < size && deltas >> (i + 1) & 1), kLeastProduct);
            factor[i] = by_light;
        }
        for (uint32_t i = 0; i < size; ++i) {
            by_eye = max(by_eye * chance(eye[i], i > 0 && deltas >> (i - 1) & 1), kLeastProduct);
            // At the first vertex all eye subpaths of a pixel are others.
            factor[i] = i == 0 ? 1.0f : max(by_eye / (by_eye + factor[i] - by_eye * factor[i]), least);
        }
    }
};

struct CorrelationMis : MergingMis {
    using Sums = CorrelationSums;

    float least_factor = 0.0f;  ///< of a merge: 1 over the light subpaths of an iteration, which are no less than one

    AMBILUX_HD float eta(const Sums& eye) const { return MergingMis::eta(eye.merging); }
    AMBILUX_HD float radius(const Sums& eye) const { return MergingMis::radius(eye.merging); }

    // ---- densities along subpaths ----

    template <Features F>
    AMBILUX_HD void start_eye(const SceneView& scene, Vec3f d, Sums& sums, SubpathStart& start) const {
        sums = {};
        MergingMis::start_eye<F>(scene, d, sums.merging, start);
        sums.pending[0] = camera_pdf<F>(scene.sensor, camera_cosine<F>(scene.sensor, d));
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD Sums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, const Sums& sums,
                            const SurfacePoint& point) const {
        const bool first = path.depth == 1;
        Sums s = {};
        if (!(first && side == Side::light)) s = sums;
        s.merging = MergingMis::sums_at<F>(scene, lights, side, path, sums.merging, point);
        const float cos_in = fabsf(dot(point.ng, path.direction)), d2 = length_squared(point.p - path.origin);
        if (!first) {
            s.add(s.pending[0] * cos_in / d2);
            s.pending[0] = s.pending[1] / d2;
        } else if (side == Side::eye) {
            const float distance = sqrtf(d2) + path.start.camera_distance;
            s.add(s.pending[0] * cos_in / (camera_delta_direction(scene.sensor) ? 1.0f : sqr(distance)));
            s.start = nearby(distance);
        } else {
            first_light<F>(scene, path.start, cos_in, d2, s);
        }
        return s;
    }
    AMBILUX_HD Sums sums_after_scatter(const Sums& sums, bool first, bool delta, float pdf_forward_sa,
                                       float pdf_reverse_sa, float cos_out) const {
        Sums s = sums.with_reverse(pdf_reverse_sa);
        s.merging = MergingMis::sums_after_scatter(sums.merging, first, delta, pdf_forward_sa, pdf_reverse_sa, cos_out);
        if (delta && s.count() <= kMostCorrelated) s.vertices |= 1u << (kDepthBits + s.count() - 1);
        s.pending[0] = pdf_forward_sa;
        s.pending[1] = cos_out;
        return s;
    }

    // ---- ratios ----

    template <Features F, class Path, class Lights>
    AMBILUX_HD bool hit_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                              uint32_t emitter, const SurfacePoint& light, float& ratio) const {
        if (ray.count() > kMostCorrelated)
            return MergingMis::hit_ratio<F>(scene, lights, path, ray.merging, emitter, light, ratio);
        if (!BidirectionalMis::hit_ratio<F>(scene, lights, path, ray.two(), emitter, light, ratio)) return false;
        if (path.depth == 1) return true;
        const Vec3f d = path.direction;
        const float d2 = length_squared(light.p - path.origin);
        CorrelatedPath p;
        p.add_eye(ray, pdf_emission_direction<F>(scene, emitter, light.ng, -d) * ray.pending[1] / d2);
        p.emitter = emitter_density<F>(scene, emitter, light.prim);
        // Of the vertex on the emitter by this strategy, over that of light subpaths.
        const float own = ray.pending[0] * -dot(light.ng, d) / d2 *
                          (F.opacity ? hit_opacity<F>(scene, emitter, light) : 1.0f) / p.emitter;
        ratio += merges_ratio(p, p.size, eta(ray) / own);
        return true;
    }
    template <Features F, class Path, class Lights>
    AMBILUX_HD bool escape_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                                 float& ratio) const {
        if (ray.count() > kMostCorrelated) return MergingMis::escape_ratio<F>(scene, lights, path, ray.merging, ratio);
        if (!BidirectionalMis::escape_ratio<F>(scene, lights, path, ray.two(), ratio)) return false;
        if (path.depth == 1) return true;
        CorrelatedPath p;
        p.add_eye(ray, pdf_emission_position<F>(scene, scene.environment, kNone) * ray.pending[1]);
        p.emitter = kInfinity;
        ratio += merges_ratio(p, p.size, eta(ray) * pdf_environment_direct<F>(scene, path.direction) / ray.pending[0]);
        return true;
    }
    template <Features F>
    AMBILUX_HD float next_event_ratio(const SceneView& scene, float over_power, const Sums& z, bool first,
                                      const EmitterSample& light, const BsdfValue& f, float cos_z) const {
        if (z.count() > kMostCorrelated)
            return MergingMis::next_event_ratio<F>(scene, over_power, z.merging, first, light, f, cos_z);
        const bool surface = light_start<F>(scene.emitters[light.emitter].type) == LightStart::surface;
        float by_light = cos_z, own = over_power;
        CorrelatedPath p;
        p.emitter = kInfinity;
        if (light.distance < kInfinity) {
            const float inv_d2 = 1.0f / sqr(light.distance);
            by_light *= pdf_emission_direction<F>(scene, light.emitter, light.ng, -light.wi) * inv_d2;
            if (surface) {
                p.emitter = emitter_density<F>(scene, light.emitter, light.prim);
                own = light.pdf_sa * fabsf(dot(light.ng, light.wi)) * inv_d2 / p.emitter;
            }
        } else {
            by_light *= pdf_emission_position<F>(scene, light.emitter, kNone);
        }
        p.add_eye(z.with_reverse(f.pdf_reverse_sa), by_light);
        return BidirectionalMis::next_event_ratio<F>(scene, over_power, z.two(), first, light, f, cos_z) +
               merges_ratio(p, p.size, eta(z) / own);
    }
    AMBILUX_HD float connection_ratio(const Sums& y, bool y_first, const Sums& z, bool z_first,
                                      const ConnectionDensities& d) const {
        if (y.count() + z.count() > kMostCorrelated)
            return MergingMis::connection_ratio(y.merging, y_first, z.merging, z_first, d);
        CorrelatedPath p;
        p.add_eye(z.with_reverse(d.z_reverse_sa), d.z_area);
        p.add_light(y.with_reverse(d.y_reverse_sa), d.y_area);
        return BidirectionalMis::connection_ratio(y.two(), y_first, z.two(), z_first, d) +
               merges_ratio(p, z.count(), eta(z) / connection_density());
    }
    template <Features F>
    AMBILUX_HD float camera_ratio(const SceneView& scene, const Sums& y, bool first, const CameraConnection& c,
                                  float cos_y, float pdf_reverse_sa) const {
        if (y.count() > kMostCorrelated)
            return MergingMis::camera_ratio<F>(scene, y.merging, first, c, cos_y, pdf_reverse_sa);
        const bool parallel = camera_delta_direction(scene.sensor);
        const float eta = now->eta * area<F>(scene.sensor, c.cos_camera, c.camera_distance);
        CorrelatedPath p;
        // Of parallel cameras where their rays begin.
        p.nearby = nearby(parallel ? c.distance : c.camera_distance);
        p.add_light(y.with_reverse(pdf_reverse_sa), camera_pdf<F>(scene.sensor, c.cos_camera) * cos_y *
                                                        (parallel ? 1.0f : 1.0f / sqr(c.camera_distance)));
        return BidirectionalMis::camera_ratio<F>(scene, y.two(), first, c, cos_y, pdf_reverse_sa) +
               merges_ratio(p, 0, eta / light_subpaths);
    }
    AMBILUX_HD float merge_ratio(const Sums& y, bool y_first, const Sums& z, bool z_first, const BsdfValue& f) const {
        if (y.count() + z.count() - 1 > kMostCorrelated)
            return MergingMis::merge_ratio(y.merging, y_first, z.merging, z_first, f);
        const uint32_t here = z.count() - 1;
        CorrelatedPath p;
        p.add_eye(z.with_reverse(f.pdf_reverse_sa), 0.0f);
        p.add_light(y.with_reverse(f.pdf_sa), 0.0f, true);
        float factor[kMostCorrelated];
        p.factors(least_factor, factor);
        const float density = eta(z) * factor[here];
        const float light = norm(connection_dvcm(y.two(), y_first), y.merging.dvc * f.pdf_sa);
        const float eye = norm(connection_dvcm(z.two(), z_first), z.merging.dvc * f.pdf_reverse_sa);
        return term(light / density) + term(eye / density) +
               merges_ratio(p, factor, here, 1.0f / (factor[here] * p.eye[here]), here);
    }

private:
    AMBILUX_HD static float nearby(float distance) { return kPi * sqr(kNearby * distance); }
    /// Of the vertex on an area emitter by light subpaths.
    template <Features F>
    AMBILUX_HD static float emitter_density(const SceneView& scene, uint32_t emitter, uint32_t prim) {
        return scene.emitters[emitter].pick_probability * pdf_emission_position<F>(scene, emitter, prim);
    }
    /// The first vertex of a light subpath, met at cosine `cos_in`. Of beams it follows from where they start.
    template <Features F>
    AMBILUX_HD static void first_light(const SceneView& scene, const SubpathStart& start, float cos_in, float d2,
                                       Sums& s) {
        const Emitter& e = scene.emitters[start.emitter];
        const float both = cos_in / start.inv_pdf;  // with the vertex on the emitter, without the fall-off
        s.start = kInfinity;
        switch (light_start<F>(e.type)) {
            case LightStart::surface:
                s.start = emitter_density<F>(scene, start.emitter, start.prim);
                s.add(both / (s.start * d2));
                break;
            case LightStart::point:
            case LightStart::hidden_surface: s.add(both / (e.pick_probability * d2)); break;
            case LightStart::distant:
            case LightStart::environment: s.add(both / start.direction); break;
            case LightStart::beam: s.add(kInfinity); break;
        }
    }

    /// Merges at all vertices but `own`, of `eye` ones by the eye subpath, over a strategy whose density is that of
    /// both subpaths over `eta_over_own`, in units of eta.
    AMBILUX_HD float merges_ratio(const CorrelatedPath& p, const float (&factor)[kMostCorrelated], uint32_t eye,
                                  float eta_over_own, uint32_t own) const {
        float sum = 0.0f;
        const auto add = [&](uint32_t i, float ratio) {
            if (i == own || p.deltas >> i & 1 || (i == 0 && !merges_first)) return;
            sum += term(ratio * factor[i]);
        };
        float others = eta_over_own;
        for (uint32_t i = eye; i < p.size; ++i) {
            add(i, others * p.eye[i]);
            others *= p.eye[i] / p.light[i];
        }
        others = eta_over_own;
        for (uint32_t i = eye; i-- > 0;) {
            add(i, others * p.light[i]);
            others *= p.light[i] / p.eye[i];
        }
        return sum;
    }
    AMBILUX_HD float merges_ratio(const CorrelatedPath& p, uint32_t eye, float eta_over_own) const {
        float factor[kMostCorrelated];
        p.factors(least_factor, factor);
        return merges_ratio(p, factor, eye, eta_over_own, kNone);
    }
};

}  // namespace ambilux
