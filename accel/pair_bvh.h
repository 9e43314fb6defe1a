// Binary BVH whose nodes hold the boxes of both children (Aila and Laine 2009, "Understanding the Efficiency of Ray
// Traversal on GPUs"): the structure to measure the wide one against. Both come from the same binary tree.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "accel/cwbvh.h"

namespace ambilux {

/// References to children: an inner node's index, or a leaf: bit 31, first primitive from bit 3 on, how many in bits 0
/// to 2.
struct alignas(16) PairNode {
    float xy[2][4];  ///< per child: lower x, upper x, lower y, upper y
    float z[4];      ///< lower and upper of the first child, then of the second
    uint32_t child[2];
    uint32_t pad[2];
};
static_assert(sizeof(PairNode) == 64);

constexpr uint32_t kPairLeaf = 0x80000000u;
/// Entries of a traversal stack; a builder refuses deeper trees.
constexpr int kPairStackSize = 96;

namespace detail {

/// Entry of a ray into a box, or false.
AMBILUX_HD bool box_entry(const CwbvhRay& ray, float lower_x, float upper_x, float lower_y, float upper_y,
                          float lower_z, float upper_z, float tmax, float& entry) {
    const float ax = (lower_x - ray.o.x) * ray.inverse_d.x, bx = (upper_x - ray.o.x) * ray.inverse_d.x;
    const float ay = (lower_y - ray.o.y) * ray.inverse_d.y, by = (upper_y - ray.o.y) * ray.inverse_d.y;
    const float az = (lower_z - ray.o.z) * ray.inverse_d.z, bz = (upper_z - ray.o.z) * ray.inverse_d.z;
    entry = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), 0.0f));
    // Rounding must not close a box (Ize 2013).
    const float exit = min(min(max(ax, bx), max(ay, by)), max(az, bz)) * (1.0f + 2.0f * gamma_bound(12));
    return entry <= min(exit, tmax);
}

/// Children of `node` that the ray meets before tmax: the nearer one in `first`, or kNone.
AMBILUX_HD void pair_hits(const PairNode& node, const CwbvhRay& ray, float tmax, uint32_t& first, uint32_t& second) {
    float t[2];
    const bool a =
        box_entry(ray, node.xy[0][0], node.xy[0][1], node.xy[0][2], node.xy[0][3], node.z[0], node.z[1], tmax, t[0]);
    const bool b =
        box_entry(ray, node.xy[1][0], node.xy[1][1], node.xy[1][2], node.xy[1][3], node.z[2], node.z[3], tmax, t[1]);
    const bool swap = b && (!a || t[1] < t[0]);
    first = swap ? node.child[1] : a ? node.child[0] : kNone;
    second = a && b ? node.child[swap ? 0 : 1] : kNone;
}

}  // namespace detail

/// Traces rays through a binary BVH. Pointers are host or device memory. The members are those of CwbvhTracer.
struct PairTracer {
    const PairNode* nodes = nullptr;
    const CwbvhPrimitive* primitives = nullptr;
    uint32_t root = kNone;  ///< a reference; kNone in an empty scene

    template <Features F>
    AMBILUX_HD bool closest(const SceneView& scene, const Ray& ray, Hit& hit) const {
        return traverse<F>(scene, ray, std::false_type(), hit);
    }
    template <Features F>
    AMBILUX_HD bool occluded(const SceneView& scene, const Ray& ray) const {
        Hit hit;
        return traverse<F>(scene, ray, std::true_type(), hit);
    }
    template <Features F>
    AMBILUX_HD bool trace(const SceneView& scene, const Ray& ray, bool any_hit, Hit& hit) const {
        return traverse<F>(scene, ray, any_hit, hit);
    }
    template <Features F, class AnyHit>
    AMBILUX_HD bool intersect_primitive(const SceneView& scene, const Ray& ray, const RayShear& shear, uint32_t index,
                                        AnyHit any_hit, Hit& hit) const {
        return CwbvhTracer{nullptr, primitives}.intersect_primitive<F>(scene, ray, shear, index, any_hit, hit);
    }

private:
    template <Features F, class AnyHit>
    AMBILUX_HD bool traverse(const SceneView& scene, const Ray& ray, AnyHit any_hit, Hit& hit) const {
        hit = {ray.tmax, 0.0f, 0.0f, kNone};
        if (!is_traceable(ray)) return false;
        const CwbvhRay box_ray = make_cwbvh_ray(ray.o, ray.d);
        const RayShear shear = make_ray_shear(ray.d);
        uint32_t stack[kPairStackSize];
        int top = 0;
        uint32_t at = root;
        while (at != kNone) {
            uint32_t second = kNone;
            if (at & kPairLeaf) {
                const uint32_t begin = (at & ~kPairLeaf) >> 3, end = begin + (at & 7u);
                for (uint32_t i = begin; i < end; ++i) {
                    const bool met = intersect_primitive<F>(scene, ray, shear, i, any_hit, hit);
                    if (any_hit && met) return true;
                }
                at = kNone;
            } else {
                detail::pair_hits(detail::load_record(nodes + at), box_ray, hit.t, at, second);
            }
            if (second != kNone) stack[top++] = second;
            if (at == kNone && top > 0) at = stack[--top];
        }
        return hit.prim != kNone;
    }
};

struct PairArrays {
    std::vector<PairNode> nodes;
    std::vector<CwbvhPrimitive> primitives;
    uint32_t root = kNone;
    uint64_t bytes() const { return nodes.size() * sizeof(PairNode) + primitives.size() * sizeof(CwbvhPrimitive); }
};

/// Makes leaves of a binary tree where that costs less, and pairs of what is left. Throws Error(device) if the tree is
/// deeper than the traversal stack.
PairArrays pair_bvh2(const SceneView& scene, const Bvh2& bvh);

/// The structure over a scene, built on the host.
class PairAccel {
public:
    explicit PairAccel(const Scene& scene);

    PairTracer tracer() const { return {arrays_.nodes.data(), arrays_.primitives.data(), arrays_.root}; }
    const PairArrays& arrays() const { return arrays_; }
    uint64_t memory_bytes() const { return arrays_.bytes(); }
    double build_seconds() const { return build_seconds_; }

private:
    PairArrays arrays_;
    double build_seconds_ = 0;
};

}  // namespace ambilux
