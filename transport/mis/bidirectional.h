// Multiple importance sampling over all strategies (s,t) of bidirectional path tracing by sums that subpaths carry
// along (van Antwerpen 2011; Georgiev 2012, "Implementing Vertex Connection and Merging", technical report). The
// derivation with every edge case is in docs/theory.md, whose equations the comments name.
//
// A path x_0 ... x_k starts at the light. Strategy (s,t) samples s vertices from the light and t = k+1-s from the
// camera with the product density p_s. The weight of a strategy is 1 / (1 + sum of (p_i/p_s)^beta over the other
// strategies i); the sum splits into one over fewer light vertices and one over more, and each follows from two numbers
// at an end of the subpath, `dvcm` and `dvc`. Densities are per area unless their name says _sa.
//
// The vertex on the light has two densities: that of a light subpath (transport/emitter/emission.h) and that of next
// event estimation, which depends on the vertex it is sampled for. dvcm at the first vertex of a light subpath holds
// their ratio.
#pragma once

#include "transport/emitter/emission.h"
#include "transport/mis/heuristic.h"
#include "transport/sensor/importance.h"
#include "transport/subpath/directions.h"
#include "transport/subpath/subpath.h"

namespace ambilux {

/// What a subpath knows of the strategies that would have sampled its vertices from the other end: norms of ratios
/// (heuristic.h).
struct MisSums {
    float dvcm, dvc;
};

/// What first rays carry to the first vertex.
struct SubpathStart {
    float inv_pdf;          ///< light: 1 / (pick · pdf_pos · pdf_dir)
    float direction;        ///< light: of an area emitter the cosine there; of the environment the density of the
                            ///< direction per solid angle, pick included
    uint32_t prim;          ///< light: of an area emitter
    uint32_t emitter;       ///< light
    uint32_t opacity_step;  ///< light: of an area emitter the chance that a ray meets it (transport/opacity.h)
    float camera_distance;  ///< eye: from the camera to the ray's origin
};

/// Densities along the segment between a light vertex y and an eye vertex z, and of the directions back along their
/// subpaths (equation 7).
struct ConnectionDensities {
    float y_area, y_reverse_sa;  ///< of y by sampling at z; of the way back from y
    float z_area, z_reverse_sa;
    float geometry = 0.0f;  ///< cosines at both, to the geometric normals, over the squared distance
};

struct BidirectionalMis {
    using Sums = MisSums;
    using Start = SubpathStart;
    using Ratio = float;
    using Directions = BsdfDirections;
    using Lights = LightsByPower;
    using Numbers = RandomNumbers;
    static constexpr bool kBidirectional = true;

    MisHeuristic heuristic;
    uint32_t strategies;   ///< StrategyBits
    float light_subpaths;  ///< per eye subpath of one pixel: of the whole image, over the samples of a pixel
    float connections;     ///< expected samples of each strategy of connections at an eye vertex: 1 for pairs

    AMBILUX_HD bool has(uint32_t bits) const { return strategies & bits; }
    /// Ratio of densities to the power that the heuristic asks for.
    AMBILUX_HD float term(float ratio) const { return heuristic_term(heuristic, ratio); }
    AMBILUX_HD float norm(float a, float b) const { return heuristic_norm(heuristic, a, b); }
    AMBILUX_HD float masked(uint32_t bits, float value) const { return has(bits) ? value : 0.0f; }
    /// Density of connections relative to that of one pair of subpaths; 0 if they are off.
    AMBILUX_HD float connection_density() const { return masked(kConnectionStrategies, connections); }

    // ---- sums along subpaths ----
    // Relative error: 10 roundings a vertex while all factors are within 1e-36 to 1e37.

    /// Density of the first vertex of an eye subpath per solid angle or, of parallel rays, per area of the sensor
    /// plane, at density 1 per pixel.
    template <Features F>
    AMBILUX_HD static float camera_pdf(const Sensor& sensor, float cos_camera) {
        return camera_delta_direction(sensor) ? camera_pdf_position(sensor)
                                              : camera_pdf_direction_sa<F>(sensor, cos_camera);
    }

    /// Sums and start of a camera ray along unit `d`.
    template <Features F>
    AMBILUX_HD void start_eye(const SceneView& scene, Vec3f d, MisSums& sums, SubpathStart& start) const {
        if constexpr (F.latlong)
            if (is_latlong(scene.sensor.type)) {
                const float sine = camera_cosine<F>(scene.sensor, d);
                sums = {masked(kLightStrategies, light_subpaths / camera_pdf<F>(scene.sensor, sine)), 0.0f};
                start.camera_distance = 0.0f;
                return;
            }
        const Vec3f axis = scene.sensor.to_world.vector({0.0f, 0.0f, 1.0f});
        const float scale = length(axis), cos_camera = dot(d, axis) / scale;
        sums = {masked(kLightStrategies, light_subpaths / camera_pdf<F>(scene.sensor, cos_camera)), 0.0f};
        start.camera_distance =
            camera_delta_direction(scene.sensor) ? 0.0f : scene.sensor.near_clip * scale / cos_camera;
    }

    AMBILUX_HD static void start_light(const EmissionSample& e, SubpathStart& start) {
        start.inv_pdf = 1.0f / (e.pick * e.pdf_pos * e.pdf_dir);
        start.direction = e.infinite ? e.pick * e.pdf_dir : e.cos_theta;
        start.prim = e.prim;
        start.emitter = e.emitter;
        start.opacity_step = opacity_step(e.opacity);
    }

    /// Sums where the ray of `path`, with sums `sums`, meets `point`.
    template <Features F, class Path, class Lights>
    AMBILUX_HD MisSums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, MisSums sums,
                               const SurfacePoint& point) const {
        const float cos_in = fabsf(dot(point.ng, path.direction));
        const bool first = path.depth == 1;
        if (side == Side::light && first) {
            const float over_power =
                lights.over_power(scene, Receiver{point.p, point.ng}, path.start.emitter, path.start.prim);
            return first_light_sums<F>(scene, path, point.p, cos_in, over_power);
        }
        float d2 = length_squared(point.p - path.origin);
        if (first) d2 = sqr(sqrtf(d2) + path.start.camera_distance);
        return sums_at_hit(sums, d2, cos_in, first && camera_delta_direction(scene.sensor));
    }

    /// Sums at a vertex that a ray of length² `d2` met at cosine `cos_in` to the geometric normal. `parallel`: the ray
    /// came from infinity or from an orthographic camera, where densities of positions do not fall off with distance.
    /// With sums_after_scatter: equations 10 to 12.
    AMBILUX_HD MisSums sums_at_hit(MisSums s, float d2, float cos_in, bool parallel) const {
        const float inv_cos = 1.0f / cos_in;
        return {s.dvcm * inv_cos * (parallel ? 1.0f : d2), s.dvc * inv_cos};
    }

    /// Sums of the ray that leaves a vertex at cosine `cos_out` to the geometric normal. `first`: the vertex is the
    /// first of its subpath that a ray met. For a delta the densities matter by their ratio alone (equation 6).
    AMBILUX_HD MisSums sums_after_scatter(MisSums s, bool first, bool delta, float pdf_forward_sa, float pdf_reverse_sa,
                                          float cos_out) const {
        if (delta) return {0.0f, cos_out * pdf_reverse_sa / pdf_forward_sa * s.dvc};
        return {1.0f / pdf_forward_sa,
                cos_out / pdf_forward_sa * norm(s.dvc * pdf_reverse_sa, connection_dvcm(s, first))};
    }

    /// dvcm where it stands for a strategy with s >= 2 and t >= 2, or one of the end strategies whose mask it holds
    /// already.
    AMBILUX_HD float connection_dvcm(MisSums s, bool first) const {
        return first ? s.dvcm : connection_density() * s.dvcm;
    }

    /// Sums at the first vertex of a light subpath, at `p`, met at cosine `cos_in` (equation 13). `over_power`: of the
    /// emitter, picked for this vertex (Mis::Lights).
    template <Features F, class Path>
    AMBILUX_HD MisSums first_light_sums(const SceneView& scene, const Path& path, Vec3f p, float cos_in,
                                        float over_power) const {
        const SubpathStart& start = path.start;
        const Emitter& e = scene.emitters[start.emitter];
        const float scale = start.inv_pdf / cos_in;
        float next_event = 0.0f, hit = 0.0f;  // densities of the light vertex from the other side times scale
        switch (light_start<F>(e.type)) {
            case LightStart::surface: {
                // Only the cosine at the emitter counts: a normal of that length along the ray has it.
                SurfacePoint light{};
                light.p = path.origin;
                light.ng = path.direction * start.direction;
                light.prim = start.prim;
                next_event =
                    pdf_emitter_direct<F>(scene, start.emitter, p, -path.direction, light) * start.direction * scale;
                hit = start.direction * scale;
                if constexpr (F.opacity) hit *= step_opacity(start.opacity_step);
                break;
            }
            case LightStart::point:
            case LightStart::hidden_surface:
                next_event = e.pick_probability * length_squared(p - path.origin) * scale;
                break;
            case LightStart::distant: next_event = e.pick_probability * scale; break;
            case LightStart::beam: break;  // no other strategy samples its light
            case LightStart::environment:
                next_event = start.direction * scale;  // samples its direction likewise
                hit = scale;
        }
        return {masked(kNextEventStrategies, next_event * over_power), masked(kHitStrategies, hit)};
    }

    // ---- ratios of the other strategies ----

    /// s = 0: the ray of `path`, with sums `ray` (not those at the hit), meets area emitter `emitter` at `light`
    /// (equation 14). False if this strategy does not count.
    template <Features F, class Path, class Lights>
    AMBILUX_HD bool hit_ratio(const SceneView& scene, const Lights& lights, const Path& path, MisSums ray,
                              uint32_t emitter, const SurfacePoint& light, float& ratio) const {
        const Vec3f d = path.direction;
        const float cos_light = -dot(light.ng, d);
        // Densities of the other strategies over the chance that a ray meets a masked emitter.
        const float inv_opacity = F.opacity ? 1.0f / hit_opacity<F>(scene, emitter, light) : 1.0f;
        const float pdf_pos = scene.emitters[emitter].pick_probability *
                              pdf_emission_position<F>(scene, emitter, light.prim) * inv_opacity;
        // The other strategy of a path of one segment is (1,1): a light vertex seen by the camera.
        if (path.depth == 1) {
            const float distance = length(light.p - path.origin) + path.start.camera_distance;
            const bool parallel = camera_delta_direction(scene.sensor);
            ratio = term(sums_at_hit(ray, sqr(distance), cos_light, parallel).dvcm * pdf_pos);
            return true;
        }
        const float next_event =
            masked(kNextEventStrategies, pdf_emitter_direct<F>(scene, emitter, path.origin, d, light)) * inv_opacity *
            lights.over_power(scene, receiver_of_ray(path.origin, path.sums), emitter, light.prim);
        const float emission = pdf_pos * pdf_emission_direction<F>(scene, emitter, light.ng, -d) / cos_light;
        ratio = term(next_event * ray.dvcm) + term(emission * ray.dvc);
        return true;
    }

    /// s = 0 where the ray leaves the scene towards the environment. A path of one segment has no other strategy: the
    /// light tracer sees the environment for itself.
    template <Features F, class Path, class Lights>
    AMBILUX_HD bool escape_ratio(const SceneView& scene, const Lights& lights, const Path& path, MisSums ray,
                                 float& ratio) const {
        ratio = 0.0f;
        if (path.depth == 1) return true;
        if (!has(kHitStrategies)) return false;
        // Light subpaths draw their directions as next event estimation does.
        const float pdf_sa = pdf_environment_direct<F>(scene, path.direction);
        const float next_event =
            pdf_sa * lights.over_power(scene, receiver_of_ray(path.origin, path.sums), scene.environment, kNone);
        const float emission = pdf_sa * pdf_emission_position<F>(scene, scene.environment, kNone);
        ratio = term(masked(kNextEventStrategies, next_event) * ray.dvcm) + term(emission * ray.dvc);
        return true;
    }

    /// s = 1: light sample `light` at an eye vertex with sums `z`. `f`: densities of BSDF sampling towards the light,
    /// and of the way back for light that arrives from there; `cos_z`: between the geometric normal and the direction
    /// to the light; `over_power`: of the emitter's pick. Equation 15.
    template <Features F>
    AMBILUX_HD float next_event_ratio(const SceneView& scene, float over_power, MisSums z, bool first,
                                      const EmitterSample& light, const BsdfValue& f, float cos_z) const {
        const Emitter& e = scene.emitters[light.emitter];
        float pdf_hit_sa = f.pdf_sa;
        if constexpr (F.opacity) pdf_hit_sa *= sample_opacity(scene, light);
        const float fewer = light.delta ? 0.0f : masked(kHitStrategies, term(pdf_hit_sa / light.pdf_sa));
        float more = cos_z / over_power;  // density of a light subpath to here over that of this sample
        switch (light_start<F>(e.type)) {
            case LightStart::surface:  // the cosine at the light is in both
                more *= over_power * e.pick_probability * pdf_emission_position<F>(scene, light.emitter, light.prim) *
                        kInvPi / light.pdf_sa;
                break;
            case LightStart::point:
            case LightStart::hidden_surface:
                more *= pdf_emission_direction<F>(scene, light.emitter, light.ng, -light.wi) / sqr(light.distance);
                break;
            case LightStart::distant:
            case LightStart::environment:  // light subpaths draw the direction as this sample was
                more *= pdf_emission_position<F>(scene, light.emitter, kNone);
                break;
            case LightStart::beam: break;  // has no such samples
        }
        return fewer + term(ratio_behind(z, first, more, f.pdf_reverse_sa));
    }

    /// One end of a connection, seen from the other: the density of this vertex by sampling there, per area, times what
    /// follows behind it (equation 7). A norm.
    AMBILUX_HD float ratio_behind(MisSums s, bool first, float pdf_area, float pdf_reverse_sa) const {
        return pdf_area * norm(connection_dvcm(s, first), s.dvc * pdf_reverse_sa);
    }

    /// s >= 2, t >= 2, in multiples of the density of connections.
    AMBILUX_HD float connection_ratio(MisSums y, bool y_first, MisSums z, bool z_first,
                                      const ConnectionDensities& p) const {
        return (term(ratio_behind(y, y_first, p.y_area, p.y_reverse_sa)) +
                term(ratio_behind(z, z_first, p.z_area, p.z_reverse_sa))) /
               term(connection_density());
    }

    /// t = 1: a light vertex with sums `y`, connected with the camera. `cos_y`: between its geometric normal and the
    /// direction to the camera. Equation 16.
    template <Features F>
    AMBILUX_HD float camera_ratio(const SceneView& scene, MisSums y, bool first, const CameraConnection& c, float cos_y,
                                  float pdf_reverse_sa) const {
        const float fall_off = camera_delta_direction(scene.sensor) ? 1.0f : 1.0f / sqr(c.camera_distance);
        const float pdf_area = camera_pdf<F>(scene.sensor, c.cos_camera) * cos_y * fall_off / light_subpaths;
        return term(ratio_behind(y, first, pdf_area, pdf_reverse_sa));
    }

    /// (1,1): a point of opacity `opacity` sampled on an area emitter with density `pdf_pos` (pick included), connected
    /// with the camera (equation 17).
    template <Features F>
    AMBILUX_HD float visible_emitter_ratio(const SceneView& scene, const CameraConnection& c, float cos_light,
                                           float pdf_pos, float opacity) const {
        const float fall_off = camera_delta_direction(scene.sensor) ? 1.0f : 1.0f / sqr(c.camera_distance);
        const float pdf_hit =
            camera_pdf<F>(scene.sensor, c.cos_camera) * cos_light * fall_off * weight_opacity(opacity);
        return masked(kHitStrategies, term(pdf_hit / (light_subpaths * pdf_pos)));
    }
    /// Eye subpaths whose last scattering was this count what their last segment meets.
    AMBILUX_HD static constexpr bool counts_last_segment(bool) { return true; }
};

}  // namespace ambilux
