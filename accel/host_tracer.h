// The tracer of the host: Embree, or the traversal of the device.
#pragma once

#include "accel/cwbvh.h"
#include "accel/embree_tracer.h"

namespace ambilux {

/// Which structure is decided at run time, so that what traces rays is compiled once. Both must outlive it.
struct HostTracer {
    EmbreeTracer embree;
    CwbvhTracer cwbvh;
    bool use_cwbvh = false;

    HostTracer() = default;
    explicit HostTracer(const EmbreeTracer& tracer) : embree(tracer) {}
    explicit HostTracer(const CwbvhTracer& tracer) : cwbvh(tracer), use_cwbvh(true) {}

    template <Features F>
    bool closest(const SceneView& scene, const Ray& ray, Hit& hit) const {
        if (__builtin_expect(use_cwbvh, 0)) return cwbvh_closest<F>(scene, ray, hit);
        return embree.closest<F>(scene, ray, hit);
    }
    template <Features F>
    bool occluded(const SceneView& scene, const Ray& ray) const {
        if (__builtin_expect(use_cwbvh, 0)) return cwbvh_occluded<F>(scene, ray);
        return embree.occluded<F>(scene, ray);
    }
    /// The same of `count` rays, kMostPacketRays at most (EmbreeTracer).
    template <Features F>
    void closest(const SceneView& scene, const Ray* rays, uint32_t count, bool coherent, Hit* hits) const {
        if (__builtin_expect(!use_cwbvh, 1)) return embree.closest<F>(scene, rays, count, coherent, hits);
        for (uint32_t k = 0; k < count; ++k) cwbvh_closest<F>(scene, rays[k], hits[k]);
    }
    template <Features F>
    void occluded(const SceneView& scene, const Ray* rays, uint32_t count, bool coherent, bool* blocked) const {
        if (__builtin_expect(!use_cwbvh, 1)) return embree.occluded<F>(scene, rays, count, coherent, blocked);
        for (uint32_t k = 0; k < count; ++k) blocked[k] = cwbvh_occluded<F>(scene, rays[k]);
    }
    /// Either of them; with `any_hit`, `hit` is not set.
    template <Features F>
    bool trace(const SceneView& scene, const Ray& ray, bool any_hit, Hit& hit) const {
        return any_hit ? occluded<F>(scene, ray) : closest<F>(scene, ray, hit);
    }

private:
    // Out of line: stages call them in several places.
    template <Features F>
    __attribute__((noinline)) bool cwbvh_closest(const SceneView& scene, const Ray& ray, Hit& hit) const {
        return cwbvh.closest<F>(scene, ray, hit);
    }
    template <Features F>
    __attribute__((noinline)) bool cwbvh_occluded(const SceneView& scene, const Ray& ray) const {
        return cwbvh.occluded<F>(scene, ray);
    }
};

}  // namespace ambilux
