// A path tracer as a plain loop over the functions of transport/, one sample at a time.
#pragma once

#include "accel/embree_tracer.h"
#include "queues/wave.h"
#include "transport/mis/heuristic.h"
#include "transport/mis/unidirectional.h"
#include "transport/subpath/next_event.h"
#include "transport/subpath/start.h"
#include "transport/subpath/visit.h"

namespace ambilux::test {

/// Adds what a vertex finds to the sample, once its way is free.
template <Features F>
struct PlainSink {
    using Mis = UnidirectionalMis;
    const SceneView& scene;
    const EmbreeTracer& tracer;
    const Rules<Mis>& rules;
    RandomNumbers subpath_numbers;
    Rgb& sample;

    RandomNumbers numbers() const { return subpath_numbers; }
    bool valid(Rgb throughput) const { return is_valid_radiance(throughput); }
    void add(const Candidate<Mis>& c) const { sample += c.value * mis_weight(c.ratio); }
    void at(const Vertex<Mis>& v, const Subpath<Mis>& path, const RandomNumbers& numbers) const {
        Candidate<Mis> c;
        if (!rules.next_event ||
            !next_event<F>(scene, rules, v, path.throughput, path.depth, numbers.next_event(path.depth), c))
            return;
        const Rgb value = c.value * mis_weight(c.ratio);
        if (is_zero(value)) return;
        const Ray ray = {c.origin, c.tmax, c.direction, F.opacity ? numbers.shadow_seed(path.depth) : 0};
        if (tracer.occluded<F>(scene, ray)) return;
        sample += c.environment ? value * environment_radiance<F>(scene, c.direction) : value;
    }
};

template <Features F>
Rgb plain_sample(const SceneView& scene, const EmbreeTracer& tracer, const Rules<UnidirectionalMis>& rules,
                 const PathSlot& p, const RngKey& key) {
    Rgb sample = {0, 0, 0};
    const RandomNumbers numbers = {key};
    const CameraSample camera = camera_sample<F>(scene, p.x, p.y, numbers);
    Subpath<UnidirectionalMis> path = start_eye<F>(scene, rules.mis, camera);
    const PlainSink<F> sink = {scene, tracer, rules, numbers, sample};
    float tmax = camera.tmax;
    for (bool goes_on = true; goes_on; tmax = kInfinity) {
        Hit hit;
        const Ray ray = {path.origin, tmax, path.direction, F.opacity ? numbers.opacity_seed(path.depth) : 0};
        if (!tracer.closest<F>(scene, ray, hit)) hit.prim = kNone;
        goes_on = visit<F>(scene, rules, Side::eye, rules.longest(Side::eye), hit, path, sink);
    }
    return sample;
}

}  // namespace ambilux::test
