// What one eye subpath, and the light subpath that goes with it, bring to the film: the primitives of transport, one
// after the other, without queues. Random numbers and decisions are those of the renderers (stages/), so that at equal
// seeds images differ by rounding alone.
#pragma once

#include <vector>

#include "render/renderer.h"
#include "render/twin/in_double/transport/mis/bidirectional.h"
#include "render/twin/in_double/transport/mis/unidirectional.h"
#include "render/twin/in_double/transport/sensor/filter.h"
#include "render/twin/in_double/transport/subpath/camera_connection.h"
#include "render/twin/in_double/transport/subpath/connection.h"
#include "render/twin/in_double/transport/subpath/next_event.h"
#include "render/twin/in_double/transport/subpath/start.h"
#include "render/twin/in_double/transport/subpath/visit.h"
#include "render/twin/tracer.h"

namespace ambilux::twin {

/// Light that lands somewhere on the film.
struct Splat {
    Vec2f film;
    Rgb value;
};

struct Counts {
    uint64_t rays_extend = 0, rays_occlude = 0;
    InvalidCounts invalid;

    void add(const Counts& other) {
        rays_extend += other.rays_extend;
        rays_occlude += other.rays_occlude;
        invalid.nan += other.invalid.nan;
        invalid.inf += other.invalid.inf;
        invalid.negative += other.invalid.negative;
    }
};

template <class Mis>
class PathSample {
public:
    PathSample(const SceneView& scene, const Tracer& tracer, const Rules<Mis>& rules, Counts& counts,
               std::vector<Splat>& splats)
        : scene_(scene), tracer_(tracer), rules_(rules), counts_(counts), splats_(splats) {}

    /// What sample `sample` of pixel (x,y) of the crop brings; splats are appended.
    Rgb operator()(uint64_t seed, uint32_t x, uint32_t y, uint32_t sample) {
        sum_ = {0, 0, 0};
        if (rules_.max_depth == 0) return sum_;
        const uint32_t pixel = y * scene_.sensor.crop_width + x;
        if constexpr (Mis::kBidirectional) {
            light_vertices_.clear();
            if (rules_.splat || rules_.connect) light_subpath({{seed, pixel, sample, Stream::light}});
        }
        const Draws draws = {{seed, pixel, sample, Stream::eye}};
        const Vec4f u = draws.camera();
        const Vec2f film = sample_film_position(scene_, x, y, {u.x, u.y});
        const CameraSample c = sample_camera_ray<kFeatures>(scene_.sensor, film, {u.z, u.w});
        follow(Side::eye, draws, start_eye<kFeatures>(scene_, rules_.mis, c), c.tmax);
        return sum_;
    }

private:
    static constexpr Features kFeatures = kAllFeatures;
    using Path = Subpath<Mis>;

    void light_subpath(const Draws& draws) {
        EmissionSample e;
        if (!sample_start<kFeatures>(scene_, draws, e)) return;
        const Path path = start_light(rules_.mis, e);
        if (!valid(path.throughput)) return;
        const Vec4f u = draws.emission_direction();
        Candidate<Mis> c;
        if (visible_emitter<kFeatures>(scene_, rules_, e, {u.z, u.w}, c)) splat(c, draws.shadow_seed(0));
        if (rules_.max_depth >= 2) follow(Side::light, draws, path, kInfinity);
    }

    void follow(Side side, const Draws& draws, Path path, double tmax) {
        const Sink sink = {*this, side, draws};
        for (;; tmax = kInfinity) {
            if (!is_finite(path.origin) || !is_finite(path.direction)) {
                ++counts_.invalid.nan;
                return;
            }
            ++counts_.rays_extend;
            const Hit hit = tracer_.closest({path.origin, tmax, path.direction, draws.opacity_seed(path.depth)});
            if (!visit<kFeatures>(scene_, rules_, side, rules_.longest(side), hit, path, sink)) return;
        }
    }

    /// Of visit().
    struct Sink {
        PathSample& sample;
        Side side;
        const Draws& subpath_draws;

        Draws draws() const { return subpath_draws; }
        void add(const Candidate<Mis>& c) const {
            Rgb value;
            if (sample.weigh(c, value)) sample.sum_ += value;
        }
        void at(const Vertex<Mis>& v, const Path& path, const Draws& draws) const {
            if (side == Side::eye)
                sample.eye_vertex(v, path, draws);
            else if constexpr (Mis::kBidirectional)
                sample.light_vertex(v, path, draws);
        }
        bool valid(Rgb throughput) const { return sample.valid(throughput); }
    };

    void eye_vertex(const Vertex<Mis>& v, const Path& path, const Draws& draws) {
        Candidate<Mis> c;
        if (next_event<kFeatures>(scene_, rules_, v, path.throughput, path.depth, draws.next_event(path.depth), c))
            collect(c, draws.shadow_seed(path.depth));
        if constexpr (Mis::kBidirectional) {
            const SubpathEnd<Mis> z = {v, path.throughput, path.depth};
            for (const SubpathEnd<Mis>& y : light_vertices_)
                if (z.depth + y.depth + 1 <= rules_.max_depth && connection<kFeatures>(rules_, z, y, c))
                    collect(c, draws.shadow_seed(connection_ray(z.depth, y.depth)));
        }
    }

    void light_vertex(const Vertex<Mis>& v, const Path& path, const Draws& draws) {
        const Vec4f u = draws.lens(path.depth);
        Candidate<Mis> c;
        if (camera_connection<kFeatures>(scene_, rules_, v, path.throughput, path.depth, {u.x, u.y}, c))
            splat(c, draws.shadow_seed(path.depth));
        if (rules_.connect && path.depth + 2 <= rules_.max_depth)
            light_vertices_.push_back({v, path.throughput, path.depth});
    }

    void collect(const Candidate<Mis>& c, uint32_t seed) {
        Rgb value;
        if (!weigh(c, value) || !free(c, seed)) return;
        if (c.environment) value *= environment_radiance<kFeatures>(scene_, c.direction);
        if (valid(value)) sum_ += value;
    }
    void splat(const Candidate<Mis>& c, uint32_t seed) {
        Rgb value;
        if (weigh(c, value) && free(c, seed)) splats_.push_back({c.film, value});
    }
    bool weigh(const Candidate<Mis>& c, Rgb& value) {
        if (!valid(c.value)) return false;
        value = c.value * mis_weight(c.ratio);
        return valid(value) && !is_zero(value);
    }
    bool free(const Candidate<Mis>& c, uint32_t seed) {
        if (!is_finite(c.origin) || !is_finite(c.direction)) {
            ++counts_.invalid.nan;
            return false;
        }
        ++counts_.rays_occlude;
        return !tracer_.occluded({c.origin, c.tmax, c.direction, seed});
    }
    /// What is no radiance is counted.
    bool valid(Rgb v) {
        if (is_valid_radiance(v) || (is_finite(v) && min_component(v) >= 0)) return true;
        if (is_finite(v))
            ++counts_.invalid.negative;
        else if (v.x != v.x || v.y != v.y || v.z != v.z)
            ++counts_.invalid.nan;
        else
            ++counts_.invalid.inf;
        return false;
    }

    const SceneView& scene_;
    const Tracer& tracer_;
    const Rules<Mis>& rules_;
    Counts& counts_;
    std::vector<Splat>& splats_;
    std::vector<SubpathEnd<Mis>> light_vertices_;
    Rgb sum_;
};

}  // namespace ambilux::twin
