// Describes what the primitives of transport/subpath/ did at a vertex, by asking them again: they are pure functions.
#pragma once

#include "integrators/shared/guide/directions.h"
#include "render/replay/context.h"
#include "render/replay/record.h"
#include "transport/subpath/connection.h"
#include "transport/subpath/trace.h"

namespace ambilux {

inline std::vector<ReplayNumber> named_sums(const UnidirectionalMis::Sums& s) { return {{"pdf_sa", s.pdf_sa}}; }
inline std::vector<ReplayNumber> named_sums(const MisSums& s) { return {{"dvcm", s.dvcm}, {"dvc", s.dvc}}; }
template <class Base, bool kBidirectional>
std::vector<ReplayNumber> named_sums(const GuidedSums<Base, kBidirectional>& s) {
    std::vector<ReplayNumber> all = named_sums(static_cast<const Base&>(s));
    all.push_back({"guide_leaf", double(s.leaf)});
    return all;
}

/// The ray of `path` and the surface that it met.
template <class Mis>
ReplayVertex describe_arrival(const ReplayContext<Mis>& ctx, Side side, const Subpath<Mis>& path, const Hit& hit) {
    constexpr Features F = kReplayFeatures;
    ReplayVertex v;
    v.depth = path.depth;
    v.origin = path.origin;
    v.direction = path.direction;
    v.throughput = path.throughput;
    v.sums = named_sums(path.sums);
    v.miss = hit.prim == kNone;
    if (v.miss) return v;
    const SurfacePoint point = surface_at<F>(ctx.view, hit.prim, hit.u, hit.v);
    const Vertex<Mis> vertex = vertex_at<F>(ctx.view, ctx.rules, side, path, point);
    v.sums = named_sums(vertex.sums);
    v.distance = length(point.p - path.origin);
    v.p = point.p;
    v.ng = point.ng;
    v.ns = vertex.scattering.frame.n;
    v.prim = point.prim;
    v.shape = point.shape;
    v.material = ctx.view.shapes[point.shape].material;
    v.emitter = ctx.view.shapes[point.shape].emitter;
    v.bsdf = name_of(vertex.scattering.bsdf.type);
    v.smooth = bsdf_is_smooth(vertex.scattering.bsdf);
    return v;
}

/// Roulette by what it does to the throughput: a survivor of the smallest random number shows the probability.
template <class Mis>
ReplayRoulette describe_roulette(const ReplayContext<Mis>& ctx, Side side, const Vertex<Mis>& vertex, Vec4f u,
                                 const Subpath<Mis>& before) {
    ReplayRoulette r;
    if (before.depth < ctx.rules.rr_depth) return r;
    Rules<Mis> never = ctx.rules;
    never.rr_depth = ~0u;
    Subpath<Mis> whole = before, thinned = before, actual = before;
    if (!scatter<kReplayFeatures>(never, side, vertex, u, whole)) return r;
    r.played = true;
    r.u = u.w;
    if (scatter<kReplayFeatures>(ctx.rules, side, vertex, {u.x, u.y, u.z, 0.0f}, thinned))
        r.survival = max_component(whole.throughput) / max_component(thinned.throughput);
    r.survived = scatter<kReplayFeatures>(ctx.rules, side, vertex, u, actual);
    return r;
}

/// Why a subpath ends that the BSDF let go on.
template <class Mis>
std::string why_scattering_ends(const ReplayContext<Mis>& ctx, const Subpath<Mis>& before, const ReplayScatter& s) {
    if (before.depth + 1 == ctx.rules.max_depth && !ctx.rules.mis.counts_last_segment(s.delta))
        return "max_depth: what the last segment could find is left to next event estimation";
    if (is_zero(before.throughput * s.weight)) return "absorbed: the throughput is 0";
    if (s.roulette.played && !s.roulette.survived) return "Russian roulette";
    return "the throughput is invalid";
}

/// What was sampled at the vertex, and why the subpath ends if it does. `before`: the subpath that arrived.
template <class Mis>
void describe_departure(const ReplayContext<Mis>& ctx, Side side, uint32_t longest, const Hit& hit,
                        const RandomNumbers& numbers, const Subpath<Mis>& before, bool goes_on, ReplayVertex& v) {
    constexpr Features F = kReplayFeatures;
    if (v.miss) return void(v.end = "the ray leaves the scene");
    if (side == Side::eye && ctx.rules.background_only)
        return void(v.end = "eye subpaths of a light tracer serve the background only");
    if (before.depth >= ctx.rules.max_depth) return void(v.end = "max_depth");
    if (before.depth >= longest) return void(v.end = "no strategy needs a longer subpath");
    const SurfacePoint point = surface_at<F>(ctx.view, hit.prim, hit.u, hit.v);
    const Vertex<Mis> vertex = vertex_at<F>(ctx.view, ctx.rules, side, before, point);
    const Vec4f u = numbers.scatter(side, before.depth);
    ScatterSample s;
    if (!ctx.rules.directions.template sample<F>(vertex, {u.x, u.y, u.z}, transport_mode(side), s))
        return void(v.end = BsdfDirections::sample<F>(vertex, {u.x, u.y, u.z}, transport_mode(side), s)
                                ? "the method goes on through delta lobes only"
                                : "the BSDF scatters nothing");
    v.scatter = {true, s.wo, s.pdf_sa, s.pdf_reverse_sa, bool(s.flags & kScatterDelta), s.weight, s.eta, {}};
    v.scatter.roulette = describe_roulette(ctx, side, vertex, u, before);
    if (!goes_on) v.end = why_scattering_ends(ctx, before, v.scatter);
}

/// trace_subpath, and with `details` what happened, in `out`. sink.arrived(path, hit) is called where each ray ends.
template <class Mis, class Sink>
void replay_subpath(const ReplayContext<Mis>& ctx, uint32_t longest, const Subpath<Mis>& first, float tmax,
                    const Sink& sink, bool details, ReplaySubpath& out) {
    std::vector<std::pair<Subpath<Mis>, Hit>> steps;
    DropWatch watch;
    const auto extend = [&](const Subpath<Mis>& path, float at_most) {
        const Hit hit = replay_extend(ctx, path, at_most, sink.numbers(), watch.record());
        watch.dropped(out.side == Side::eye ? "extend" : "light_extend", out.drop);
        if (details) steps.emplace_back(path, hit);
        sink.arrived(path, hit);
        return hit;
    };
    trace_subpath<kReplayFeatures>(ctx.view, ctx.rules, out.side, longest, first, tmax, extend, sink);
    for (const auto& [path, hit] : steps) {
        out.vertices.push_back(describe_arrival(ctx, out.side, path, hit));
        const bool goes_on = out.vertices.size() < steps.size();
        describe_departure(ctx, out.side, longest, hit, sink.numbers(), path, goes_on, out.vertices.back());
    }
}

// ---- densities behind a candidate ----

/// s = 0: of the emitter that the ray of `path` met.
template <class Mis>
std::vector<ReplayNumber> hit_densities(const ReplayContext<Mis>& ctx, const Subpath<Mis>& path, const Hit& hit) {
    constexpr Features F = kReplayFeatures;
    const auto over_power = [&](uint32_t emitter, uint32_t prim) {
        return ctx.rules.lights.over_power(ctx.view, receiver_of_ray(path.origin, path.sums), emitter, prim);
    };
    if (hit.prim == kNone)
        return {{"pdf_next_event_sa",
                 pdf_environment_direct<F>(ctx.view, path.direction) * over_power(ctx.view.environment, kNone)}};
    const SurfacePoint light = surface_at<F>(ctx.view, hit.prim, hit.u, hit.v);
    const uint32_t emitter = ctx.view.shapes[light.shape].emitter;
    const Emitter& e = ctx.view.emitters[emitter];
    const float pick = e.pick_probability;
    return {{"opacity", area_opacity<F>(ctx.view, e, light.uv)},
            {"pdf_next_event_sa", pdf_emitter_direct<F>(ctx.view, emitter, path.origin, path.direction, light) *
                                      over_power(emitter, light.prim)},
            {"pdf_emission_area", pick * pdf_emission_position<F>(ctx.view, emitter, light.prim)},
            {"pdf_emission_sa", pdf_emission_direction<F>(ctx.view, emitter, light.ng, -path.direction)}};
}

/// s = 1, with the random numbers `u`.
template <class Mis>
std::vector<ReplayNumber> next_event_densities(const ReplayContext<Mis>& ctx, const Vertex<Mis>& z, Vec4f u) {
    constexpr Features F = kReplayFeatures;
    EmitterSample light;
    typename Mis::Lights::Pick pick;
    if (!sample_emitter_deferred<F>(ctx.view, ctx.rules.lights, {z.point.p, z.point.ng}, u, light, pick)) return {};
    const BsdfValue f = ctx.rules.directions.template evaluate<F>(z, light.wi, TransportMode::radiance);
    return {{"emitter", double(light.emitter)},
            {light.delta ? "pick_probability" : "pdf_next_event_sa", light.pdf_sa},
            {"distance", light.distance},
            {"pdf_bsdf_sa", f.pdf_sa},
            {"pdf_bsdf_reverse_sa", f.pdf_reverse_sa}};
}

/// s, t >= 2.
template <class Mis>
std::vector<ReplayNumber> connection_densities(const SubpathEnd<Mis>& z, const SubpathEnd<Mis>& y) {
    constexpr Features F = kReplayFeatures;
    const Vec3f to_y = y.vertex.point.p - z.vertex.point.p;
    const float distance = length(to_y);
    const Vec3f w = to_y / distance;
    const BsdfValue f_z = scatter_evaluate<F>(z.vertex.scattering, w, TransportMode::radiance);
    const BsdfValue f_y = scatter_evaluate<F>(y.vertex.scattering, -w, TransportMode::importance);
    return {{"distance", distance},
            {"pdf_eye_sa", f_z.pdf_sa},
            {"pdf_eye_reverse_sa", f_z.pdf_reverse_sa},
            {"pdf_light_sa", f_y.pdf_sa},
            {"pdf_light_reverse_sa", f_y.pdf_reverse_sa}};
}

/// t = 1 from a point on a light subpath, seen through the lens point of `lens_u`.
inline std::vector<ReplayNumber> camera_densities(const SceneView& view, Vec3f p, Vec2f lens_u) {
    CameraConnection camera;
    if (!connect_to_camera<kReplayFeatures>(view.sensor, p, lens_u, camera)) return {};
    const char* name = camera_delta_direction(view.sensor) ? "pdf_camera_area" : "pdf_camera_sa";
    return {{"distance", camera.camera_distance},
            {name, BidirectionalMis::camera_pdf<kReplayFeatures>(view.sensor, camera.cos_camera)}};
}

}  // namespace ambilux
