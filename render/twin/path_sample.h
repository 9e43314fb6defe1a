// What one eye subpath, and the light subpath that goes with it, bring to the film: the primitives of transport, one
// after the other, without queues. Random numbers and decisions are those of the renderers (stages/), so that at equal
// seeds images differ by rounding alone.
#pragma once

#include <vector>

#include "render/renderer.h"
#include "render/twin/in_double/transport/mis/bidirectional.h"
#include "render/twin/in_double/transport/mis/unidirectional.h"
#include "render/twin/in_double/transport/subpath/connection.h"
#include "render/twin/in_double/transport/subpath/next_event.h"
#include "render/twin/in_double/transport/subpath/start.h"
#include "render/twin/in_double/transport/subpath/trace.h"
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
        const RandomNumbers numbers = {{seed, pixel, sample, Stream::eye}};
        double tmax;
        const Path first = start_eye_subpath<kFeatures>(scene_, rules_.mis, x, y, numbers, tmax);
        follow(first, tmax, Sink{*this, Side::eye, numbers});
        return sum_;
    }

private:
    static constexpr Features kFeatures = kAllFeatures;
    using Path = Subpath<Mis>;

    void light_subpath(const RandomNumbers& numbers) {
        EmissionSample e;
        Path first;
        const Sink sink = {*this, Side::light, numbers};
        if (start_light_subpath<kFeatures>(scene_, rules_, numbers, sink, e, first)) follow(first, kInfinity, sink);
    }

    /// Of visit().
    struct Sink {
        PathSample& sample;
        Side side;
        const RandomNumbers& subpath_numbers;

        RandomNumbers numbers() const { return subpath_numbers; }
        void add(const Candidate<Mis>& c) const {
            if (side == Side::light) return sample.splat(c, subpath_numbers.shadow_seed(0));
            Rgb value;
            if (sample.weigh(c, value)) sample.sum_ += value;
        }
        void at(const Vertex<Mis>& v, const Path& path, const RandomNumbers& numbers) const {
            if (side == Side::eye)
                sample.eye_vertex(v, path, numbers);
            else if constexpr (Mis::kBidirectional)
                sample.light_vertex(v, path, numbers);
        }
        bool valid(Rgb throughput) const { return sample.valid(throughput); }
    };

    /// A ray that is invalid meets nothing, and is counted.
    void follow(const Path& first, double tmax, const Sink& sink) {
        const auto extend = [&](const Path& path, double at_most) -> Hit {
            if (is_finite(path.origin) && is_finite(path.direction)) {
                ++counts_.rays_extend;
                const uint32_t seed = sink.subpath_numbers.opacity_seed(path.depth);
                return tracer_.closest({path.origin, at_most, path.direction, seed});
            }
            ++counts_.invalid.nan;
            return {at_most, 0.0, 0.0, kNone};
        };
        trace_subpath<kFeatures>(scene_, rules_, sink.side, rules_.longest(sink.side), first, tmax, extend, sink);
    }

    void eye_vertex(const Vertex<Mis>& v, const Path& path, const RandomNumbers& numbers) {
        Candidate<Mis> c;
        if (next_event<kFeatures>(scene_, rules_, v, path.throughput, path.depth, numbers.next_event(path.depth), c))
            collect(c, numbers.shadow_seed(path.depth));
        if constexpr (Mis::kBidirectional) {
            const SubpathEnd<Mis> z = {v, path.throughput, path.depth};
            for (const SubpathEnd<Mis>& y : light_vertices_)
                if (z.depth + y.depth + 1 <= rules_.max_depth && connection<kFeatures>(rules_, z, y, c))
                    collect(c, numbers.shadow_seed(connection_ray(z.depth, y.depth)));
        }
    }

    void light_vertex(const Vertex<Mis>& v, const Path& path, const RandomNumbers& numbers) {
        const Vec4f u = numbers.lens(path.depth);
        Candidate<Mis> c;
        if (camera_connection<kFeatures>(scene_, rules_, v, path.throughput, path.depth, {u.x, u.y}, c))
            splat(c, numbers.shadow_seed(path.depth));
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
        if (is_valid_radiance(v)) return true;
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
