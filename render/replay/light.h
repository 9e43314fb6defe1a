// A light subpath again: what it leaves for connections and what it brings to the film.
#pragma once

#include <functional>

#include "render/replay/arrival.h"
#include "render/replay/describe.h"
#include "stages/generate.h"
#include "stages/light_vertex.h"

namespace ambilux {

template <class Mis>
struct ReplayLight {
    ReplaySubpath subpath;
    std::vector<ConnectionVertex<Mis>> vertices;  ///< as a wave keeps them, without links
    std::vector<ReplayCandidate> splats;
};

/// Which light subpath, and what is asked of it.
template <class Mis>
struct ReplayLightRequest {
    uint64_t seed = 0;
    uint32_t number = 0, part = 0, sample = 0;  ///< ReplaySubpath
    uint32_t longest = 0;                       ///< segments
    bool splats = true;                         ///< vertices are connected with the camera
    bool details = true;                        ///< vertices and densities are described
    /// False for places on the film that do not matter: no shadow ray is traced for them.
    std::function<bool(Vec2f film)> matters = [](Vec2f) { return true; };
    /// True for vertices that connections may use.
    std::function<bool(const Vertex<Mis>&, uint32_t depth)> keeps;
    /// Sees where its rays end; may be empty.
    std::function<void(const Subpath<Mis>&, const Hit&)> arrived;

    RandomNumbers numbers() const { return {{seed, number, sample, Stream::light}, part}; }
};

/// A splat candidate goes through the stages of a render.
template <class Mis>
struct ReplaySplats {
    const ReplayContext<Mis>& ctx;
    const ReplayLightRequest<Mis>& request;
    ReplayLight<Mis>& light;

    uint32_t push(const CandidateItem& c) const {
        if (!request.splats || !request.matters(c.film)) return 0;
        ReplayCandidate out;
        out.kind = "camera";
        out.light_subpath = request.number;
        out.light_depth = c.strategy.s() - 1;
        splat_arrival(ctx, c, out);
        light.splats.push_back(out);
        return 0;
    }
    /// A candidate was dropped before it had a weight.
    void invalid(const ReplayDrop& drop, Strategy strategy) const {
        ReplayCandidate out;
        out.kind = "camera";
        out.light_subpath = request.number;
        out.light_depth = strategy.s() - 1;
        out.strategy = strategy;
        out.fate = ReplayFate::invalid;
        out.drop = drop;
        light.splats.push_back(out);
    }
};

template <class Mis>
struct ReplayLightSink {
    const ReplaySplats<Mis>& splats;

    RandomNumbers numbers() const { return splats.request.numbers(); }
    void arrived(const Subpath<Mis>& path, const Hit& hit) const {
        if (splats.request.arrived) splats.request.arrived(path, hit);
    }
    void add(const Candidate<Mis>&) const {}
    void at(const Vertex<Mis>& y, const Subpath<Mis>& path, const RandomNumbers& d) const {
        const auto& [ctx, request, light] = splats;
        if (ctx.rules.splat && request.splats && ctx.rules.wants(path.depth + 1, 1)) {
            DropWatch watch;
            ReplayDrop drop;
            const size_t before = light.splats.size();
            ConnectCamera<kReplayFeatures, Mis, ReplaySplats<Mis>>{splats, watch.record()}.at(ctx.view, ctx.rules, y,
                                                                                              path, 0, d);
            if (watch.dropped("connect_camera", drop)) splats.invalid(drop, Strategy::make(path.depth + 1, 1));
            const Vec4f u = d.lens(path.depth);
            if (request.details && light.splats.size() > before)
                light.splats.back().densities = camera_densities(ctx.view, y.point.p, {u.x, u.y});
        }
        if (request.keeps && request.keeps(y, path.depth))
            light.vertices.push_back(pack_connection_vertex(y, path, kNone));
    }
    bool valid(Rgb throughput) const {
        DropWatch watch;
        if (is_valid_radiance(throughput, watch.record())) return true;
        watch.dropped("light_shade", splats.light.subpath.drop);
        return false;
    }
};

/// The emission that the subpath begins with, in words.
template <class Mis>
void describe_start(const ReplayContext<Mis>& ctx, const EmissionSample& e, ReplaySubpath& subpath) {
    subpath.emitter = name_of(ctx.view.emitters[e.emitter].type);
    subpath.start = e.radiance;
    subpath.start_densities = {{"emitter", double(e.emitter)},
                               {"pick_probability", e.pick},
                               {e.delta_position ? "probability_position" : "pdf_position_area", e.pdf_pos},
                               {e.delta_direction ? "probability_direction" : "pdf_direction_sa", e.pdf_dir},
                               {"cos_theta", e.cos_theta}};
}

template <class Mis>
ReplayLight<Mis> replay_light(const ReplayContext<Mis>& ctx, const ReplayLightRequest<Mis>& request) {
    ReplayLight<Mis> light;
    ReplaySubpath& subpath = light.subpath;
    subpath.side = Side::light;
    subpath.number = request.number;
    subpath.part = request.part;
    const RandomNumbers numbers = request.numbers();
    const ReplaySplats<Mis> splats = {ctx, request, light};
    DropWatch watch;
    const LightStartSink<kReplayFeatures, Mis, ReplaySplats<Mis>> start = {splats, 0, numbers, watch.record()};
    EmissionSample e;
    Subpath<Mis> first{};  // depth 0
    const bool starts = start_light_subpath<kReplayFeatures>(ctx.view, ctx.rules, numbers, start, e, first);
    if (request.details && first.depth > 0) describe_start(ctx, e, subpath);
    const bool valid = is_valid_radiance(first.throughput);
    ReplayDrop drop;
    if (watch.dropped("light_generate", drop)) {
        if (valid)
            splats.invalid(drop, Strategy::make(1, 1));
        else
            subpath.drop = drop;
    }
    if (!starts) {
        subpath.end = !valid                    ? "the flux of the emitter sample is invalid"
                      : ctx.rules.max_depth < 2 ? "max_depth"
                                                : "the emitter sample carries no light";
        return light;
    }
    replay_subpath(ctx, request.longest, first, kInfinity, ReplayLightSink<Mis>{splats}, request.details, subpath);
    return light;
}

}  // namespace ambilux
