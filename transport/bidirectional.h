// Multiple importance sampling over all strategies (s,t) of bidirectional path tracing by sums that walks carry along
// (van Antwerpen 2011; Georgiev 2012, "Implementing Vertex Connection and Merging", technical report). The derivation
// with every edge case is in docs/theory.md, whose equations the comments name.
//
// A path x_0 ... x_k starts at the light. Strategy (s,t) samples s vertices from the light and t = k+1-s from the
// camera with the product density p_s. The weight of a strategy is 1 / (1 + sum of (p_i/p_s)^beta over the other
// strategies i); the sum splits into one over fewer light vertices and one over more, and each follows from two numbers
// at an end of the walk, `dvcm` and `dvc`. Densities are per area unless their name says _sa.
//
// The vertex on the light has two densities: that of a light walk (transport/emitter/emission.h) and that of next event
// estimation, which depends on the vertex it is sampled for. dvcm at the first vertex of a light walk holds their
// ratio.
#pragma once

#include "transport/emitter/emission.h"
#include "transport/mis.h"
#include "transport/sensor/importance.h"

namespace ambilux {

/// Groups of strategies that can be switched off; weights then sum to one over the rest.
enum StrategyBits : uint32_t {
    kHitStrategies = 1,         ///< s = 0: the eye walk meets an emitter
    kNextEventStrategies = 2,   ///< s = 1, t >= 2
    kConnectionStrategies = 4,  ///< s >= 2, t >= 2
    kLightStrategies = 8,       ///< t = 1
    kAllStrategies = 15
};

struct BidirectionalMis {
    MisHeuristic heuristic;
    uint32_t strategies;  ///< StrategyBits
    float light_walks;    ///< light walks per eye walk of one pixel: of the whole image, over the samples of a pixel
    float connections;    ///< expected number of times that a vertex of an eye walk meets a given light walk: 1 for
                          ///< paired walks

    AMBILUX_HD bool has(uint32_t bits) const { return strategies & bits; }
    /// Ratio of densities to the power that the heuristic asks for.
    AMBILUX_HD float term(float ratio) const { return heuristic == MisHeuristic::power ? ratio * ratio : ratio; }
    AMBILUX_HD float masked(uint32_t bits, float value) const { return has(bits) ? value : 0.0f; }
    /// Density of connections relative to that of one pair of walks, to the power of the heuristic; 0 if they are off.
    AMBILUX_HD float connection_term() const { return masked(kConnectionStrategies, term(connections)); }
};

/// What a walk knows of the strategies that would have sampled its vertices from the other end.
struct MisSums {
    float dvcm, dvc;
};

// ---- eye walks ----

/// Density of the first vertex of an eye walk per solid angle (perspective, thin lens) or per area of the sensor plane
/// (orthographic), at density 1 per pixel.
AMBILUX_HD float camera_walk_pdf(const Sensor& sensor, float cos_camera) {
    return camera_delta_direction(sensor) ? camera_pdf_position(sensor) : camera_pdf_direction_sa(sensor, cos_camera);
}

/// Sums of a camera ray.
AMBILUX_HD MisSums camera_sums(const BidirectionalMis& mis, const Sensor& sensor, float cos_camera) {
    return {mis.masked(kLightStrategies, mis.term(mis.light_walks / camera_walk_pdf(sensor, cos_camera))), 0.0f};
}

/// Sums at a vertex that a ray of length² `d2` met at cosine `cos_in` to the geometric normal. `parallel`: the ray came
/// from infinity or from an orthographic camera, where densities of positions do not fall off with distance. With
/// sums_after_scatter: equations 10 to 12.
AMBILUX_HD MisSums sums_at_hit(const BidirectionalMis& mis, MisSums s, float d2, float cos_in, bool parallel) {
    const float inv_cos = mis.term(1.0f / cos_in);
    return {s.dvcm * inv_cos * (parallel ? 1.0f : mis.term(d2)), s.dvc * inv_cos};
}

/// Sums of the ray that leaves a vertex at cosine `cos_out` to the geometric normal. `first`: the vertex is the first
/// of the walk that lies on a surface met by a ray. For a delta the densities matter by their ratio alone (equation 6).
AMBILUX_HD MisSums sums_after_scatter(const BidirectionalMis& mis, MisSums s, bool first, bool delta,
                                      float pdf_forward_sa, float pdf_reverse_sa, float cos_out) {
    if (delta) return {0.0f, mis.term(cos_out * pdf_reverse_sa / pdf_forward_sa) * s.dvc};
    const float connection = first ? s.dvcm : mis.connection_term() * s.dvcm;
    return {mis.term(1.0f / pdf_forward_sa),
            mis.term(cos_out / pdf_forward_sa) * (s.dvc * mis.term(pdf_reverse_sa) + connection)};
}

/// dvcm where it stands for a strategy with s >= 2 and t >= 2, or one of the end strategies whose mask it holds
/// already.
AMBILUX_HD float connection_dvcm(const BidirectionalMis& mis, MisSums s, bool first) {
    return first ? s.dvcm : mis.connection_term() * s.dvcm;
}

// ---- light walks ----

/// What a light walk carries to its first vertex, where the density of next event estimation becomes known.
struct LightStart {
    float inv_pdf;    ///< 1 / (pick · pdf_pos · pdf_dir)
    float direction;  ///< area: cosine at the emitter; environment: density of the direction per solid angle, pick
                      ///< included; otherwise unused
    uint32_t prim;    ///< of an area emitter
    uint32_t emitter;
};

/// Sums at the first vertex of a light walk: at `p`, met by a ray from `o` along `d` at cosine `cos_in` (equation 13).
template <Features F>
AMBILUX_HD MisSums light_sums_at_first_hit(const SceneView& scene, const BidirectionalMis& mis, const LightStart& start,
                                           Vec3f o, Vec3f d, Vec3f p, float cos_in) {
    const Emitter& e = scene.emitters[start.emitter];
    const float scale = start.inv_pdf / cos_in;
    float next_event = 0.0f, hit = 0.0f;  // densities of the light vertex from the other side times scale
    switch (e.type) {
        case EmitterType::area: {
            // Only the cosine at the emitter counts: a normal of that length along the ray has it.
            SurfacePoint light{};
            light.p = o;
            light.ng = d * start.direction;
            light.prim = start.prim;
            next_event = pdf_emitter_direct<F>(scene, start.emitter, p, -d, light) * start.direction * scale;
            hit = start.direction * scale;
            break;
        }
        case EmitterType::point:
        case EmitterType::spot: next_event = e.pick_probability * length_squared(p - o) * scale; break;
        case EmitterType::directional: next_event = e.pick_probability * scale; break;
        default:
            next_event = start.direction * scale;  // samples its direction likewise
            hit = scale;
    }
    return {mis.masked(kNextEventStrategies, mis.term(next_event)), mis.masked(kHitStrategies, mis.term(hit))};
}

// ---- sums of the other strategies; the weight is 1 / (1 + sum) ----

/// s = 0: an eye ray of `depth` segments from `o` along unit `d` with sums `ray` (not those at the hit) meets area
/// emitter `emitter` at `light`. `start_distance`: from the camera to o on a first ray. Equation 14.
template <Features F>
AMBILUX_HD float others_of_hit(const SceneView& scene, const BidirectionalMis& mis, MisSums ray, uint32_t depth,
                               uint32_t emitter, Vec3f o, Vec3f d, float start_distance, const SurfacePoint& light) {
    const float cos_light = -dot(light.ng, d);
    const float pdf_pos =
        scene.emitters[emitter].pick_probability * pdf_emission_position<F>(scene, emitter, light.prim);
    // The other strategy of a path of one segment is (1,1): a light vertex seen by the camera.
    if (depth == 1) {
        const MisSums s = sums_at_hit(mis, ray, sqr(length(light.p - o) + start_distance), cos_light,
                                      camera_delta_direction(scene.sensor));
        return s.dvcm * mis.term(pdf_pos);
    }
    const float next_event =
        mis.masked(kNextEventStrategies, mis.term(pdf_emitter_direct<F>(scene, emitter, o, d, light)));
    const float emission = mis.term(pdf_pos * pdf_emission_direction<F>(scene, emitter, light.ng, -d) / cos_light);
    return next_event * ray.dvcm + emission * ray.dvc;
}

/// s = 0 where the ray leaves the scene towards the environment. A path of one segment has no other strategy: the light
/// tracer sees the environment for itself.
template <Features F>
AMBILUX_HD float others_of_escape(const SceneView& scene, const BidirectionalMis& mis, MisSums ray, uint32_t depth,
                                  Vec3f d) {
    if (depth == 1) return 0.0f;
    // Eye walks count the environment for two masks, and beyond the first segment for one only.
    if (!mis.has(kHitStrategies)) return kInfinity;
    // Light walks draw their directions as next event estimation does.
    const float pdf_sa = pdf_environment_direct<F>(scene, d),
                emission = pdf_sa * pdf_emission_position<F>(scene, scene.environment, kNone);
    return mis.masked(kNextEventStrategies, mis.term(pdf_sa)) * ray.dvcm + mis.term(emission) * ray.dvc;
}

/// s = 1: light sample `light` at an eye vertex with sums `z`. `pdf_sa`: of BSDF sampling towards the light;
/// `pdf_reverse_sa`: of the direction back along the eye walk for light that arrives from the sample; `cos_z`: between
/// the geometric normal and the direction to the light. Equation 15.
template <Features F>
AMBILUX_HD float others_of_next_event(const SceneView& scene, const BidirectionalMis& mis, MisSums z, bool first,
                                      const EmitterSample& light, float pdf_sa, float pdf_reverse_sa, float cos_z) {
    const Emitter& e = scene.emitters[light.emitter];
    const float fewer = light.delta ? 0.0f : mis.masked(kHitStrategies, mis.term(pdf_sa / light.pdf_sa));
    float ratio = cos_z;  // density of a light walk to here over that of this sample
    switch (e.type) {
        case EmitterType::area:
            ratio *= e.pick_probability * pdf_emission_position<F>(scene, light.emitter, light.prim) * kInvPi /
                     light.pdf_sa;  // the cosine at the light is in both
            break;
        case EmitterType::point:
        case EmitterType::spot:
            ratio *= pdf_emission_direction<F>(scene, light.emitter, light.ng, -light.wi) / sqr(light.distance);
            break;
        default:
            ratio *= pdf_emission_position<F>(scene, light.emitter,
                                              kNone);  // light walks draw the direction as this sample was
    }
    return fewer + mis.term(ratio) * (connection_dvcm(mis, z, first) + z.dvc * mis.term(pdf_reverse_sa));
}

/// One end of a connection, seen from the other: the density of this vertex by sampling there, per area, times what
/// follows behind it (equation 7).
AMBILUX_HD float others_behind(const BidirectionalMis& mis, MisSums s, bool first, float pdf_area,
                               float pdf_reverse_sa) {
    return mis.term(pdf_area) * (connection_dvcm(mis, s, first) + s.dvc * mis.term(pdf_reverse_sa));
}

/// t = 1: a light vertex with sums `y`, connected with the camera. `cos_y`: between its geometric normal and the
/// direction to the camera. Equation 16.
AMBILUX_HD float others_of_camera(const SceneView& scene, const BidirectionalMis& mis, MisSums y, bool first,
                                  const CameraConnection& c, float cos_y, float pdf_reverse_sa) {
    const float fall_off = camera_delta_direction(scene.sensor) ? 1.0f : 1.0f / sqr(c.camera_distance);
    return others_behind(mis, y, first,
                         camera_walk_pdf(scene.sensor, c.cos_camera) * cos_y * fall_off / mis.light_walks,
                         pdf_reverse_sa);
}

/// (1,1): a point sampled on an area emitter with density `pdf_pos` (pick included), connected with the camera
/// (equation 17).
AMBILUX_HD float others_of_visible_light(const SceneView& scene, const BidirectionalMis& mis, const CameraConnection& c,
                                         float cos_light, float pdf_pos) {
    const float fall_off = camera_delta_direction(scene.sensor) ? 1.0f : 1.0f / sqr(c.camera_distance);
    return mis.masked(kHitStrategies, mis.term(camera_walk_pdf(scene.sensor, c.cos_camera) * cos_light * fall_off /
                                               (mis.light_walks * pdf_pos)));
}

}  // namespace ambilux
