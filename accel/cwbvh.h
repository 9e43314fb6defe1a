// Compressed wide BVH (Ylitie, Karras, Laine 2017): the structure that CUDA kernels traverse, and a traversal that runs
// anywhere.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "accel/cwbvh_node.h"
#include "accel/ends_on_disk.h"
#include "accel/opacity.h"
#include "accel/quadric_intersect.h"
#include "accel/traceable.h"
#include "accel/triangle_test.h"

namespace ambilux {

struct Scene;
struct Bvh2;

/// Traces rays through a CWBVH, of a scene whose surfaces are all opaque unless F.opacity. Pointers are host or device
/// memory.
struct CwbvhTracer {
    const CwbvhNode* nodes = nullptr;            ///< the root is nodes[0]; it has no children in an empty scene
    const CwbvhPrimitive* primitives = nullptr;  ///< in the order of leaves

    /// Nearest hit with 0 < t < ray.tmax; without one, hit.prim is kNone and the result is false.
    template <Features F>
    AMBILUX_HD bool closest(const SceneView& scene, const Ray& ray, Hit& hit) const {
        return traverse<F>(scene, ray, std::false_type(), hit);
    }

    /// True if anything lies at 0 < t < ray.tmax.
    template <Features F>
    AMBILUX_HD bool occluded(const SceneView& scene, const Ray& ray) const {
        Hit hit;
        return traverse<F>(scene, ray, std::true_type(), hit);
    }

    /// Either of them by the same instructions, for lanes of a warp that ask for one and the other. With `any_hit`,
    /// `hit` is any of those on the way.
    template <Features F>
    AMBILUX_HD bool trace(const SceneView& scene, const Ray& ray, bool any_hit, Hit& hit) const {
        return traverse<F>(scene, ray, any_hit, hit);
    }

    /// Tests one entry of `primitives`; updates `hit` and returns true if the ray meets it at 0 < t < hit.t. `any_hit`:
    /// a bool, or a constant; hit.t is where the ray ends then.
    template <Features F, class AnyHit>
    AMBILUX_HD bool intersect_primitive(const SceneView& scene, const Ray& ray, const RayShear& shear, uint32_t index,
                                        AnyHit any_hit, Hit& hit, uint32_t id_offset = 0) const {
        const CwbvhPrimitive p = detail::load_record(primitives + index);
        if constexpr (F.has_quadrics()) {
            if (!scene.is_triangle(p.template prim<F>())) {
                const Quadric& quadric = scene.quadric(p.template prim<F>());
                if (F.has(PrimitiveType::disk) && any_hit && ends_on_disk(quadric, {ray.o, hit.t, ray.d, 0}))
                    return false;
                const QuadricCrossings hits = quadric_crossings<F>(quadric, ray.o, ray.d, hit.t);
                for (int i = 0; i < hits.count; ++i) {
                    if (!accepts<F>(scene, ray, p, hits.u[i], hits.v[i])) continue;
                    hit = {hits.t[i], hits.u[i], hits.v[i], p.template prim<F>()};
                    return true;
                }
                return false;
            }
        }
        TriangleCrossing crossing;
        const auto normal = [&] {
            const Vec3f a = p.v1 - p.v0, b = p.v2 - p.v0;
            return Vec3f{p.normal_x, p.normal_y, detail::difference_of_products(a.x, b.y, a.y, b.x)};
        };
        if (!intersect_triangle(ray.o, ray.d, shear, p.v0, p.v1, p.v2, hit.t, crossing, normal)) return false;
        if (!accepts<F>(scene, ray, p, crossing.u, crossing.v, id_offset)) return false;
        hit = {crossing.t, crossing.u, crossing.v, p.template prim<F>() + (F.instances ? id_offset : 0u)};
        return true;
    }

private:
    template <Features F>
    AMBILUX_HD static bool accepts(const SceneView& scene, const Ray& ray, const CwbvhPrimitive& p, float u, float v,
                                   uint32_t id_offset = 0) {
        if constexpr (F.opacity)
            return !p.lets_pass() || accept_hit<F>(scene, ray, p.template prim<F>(), u, v, id_offset);
        return true;
    }
    /// `AnyHit`: a bool, or a constant.
    template <Features F, class AnyHit>
    AMBILUX_HD bool traverse(const SceneView& scene, const Ray& ray, AnyHit any_hit, Hit& hit) const {
        if constexpr (F.instances) return traverse_instances<F>(scene, ray, any_hit, hit);
        hit = {ray.tmax, 0.0f, 0.0f, kNone};
        if (!is_traceable(ray)) return false;
        const CwbvhRay box_ray = make_cwbvh_ray(ray.o, ray.d);
        const RayShear shear = make_ray_shear(ray.d);
        CwbvhGroup stack[kCwbvhStackSize];
        int top = 0;
        CwbvhGroup group = {0, 0x80000000u};  // the root, as the only child of nobody
        for (;;) {
            const uint32_t index = take_child(group, box_ray.order);
            if (group.hits & kCwbvhInnerBits) stack[top++] = group;
            const CwbvhNode node = detail::load_record(nodes + index);
            const uint32_t hits = child_hits(node, box_ray, hit.t);
            group = inner_hits(node, hits, box_ray.order);
            for (CwbvhLeaves leaves = leaf_hits(node, hits); leaves.hits;) {
                const bool met = intersect_primitive<F>(scene, ray, shear, take_primitive(leaves), any_hit, hit);
                if (any_hit && met) return true;
            }
            if (!(group.hits & kCwbvhInnerBits)) {
                if (top == 0) break;
                group = stack[--top];
            }
        }
        return hit.prim != kNone;
    }
    /// The same through two levels: at an instance the ray goes on in the group's tree, until the stack is where it
    /// was.
    template <Features F, class AnyHit>
    AMBILUX_HD bool traverse_instances(const SceneView& scene, const Ray& ray, AnyHit any_hit, Hit& hit) const {
        hit = {ray.tmax, 0.0f, 0.0f, kNone};
        if (!is_traceable(ray)) return false;
        Ray here = ray;
        CwbvhRay box_ray = make_cwbvh_ray(ray.o, ray.d);
        RayShear shear = make_ray_shear(ray.d);
        CwbvhGroup stack[kCwbvhStackSize];
        int top = 0, floor = -1;  // floor: of the stack while in a group
        uint32_t id_offset = 0;
        const auto move_to = [&](Vec3f o, Vec3f d) {
            here.o = o, here.d = d;
            box_ray = make_cwbvh_ray(o, d);
            shear = make_ray_shear(d);
        };
        CwbvhGroup group = {0, 0x80000000u};
        for (;;) {
            const uint32_t index = take_child(group, box_ray.order);
            if (group.hits & kCwbvhInnerBits) stack[top++] = group;
            const CwbvhNode node = detail::load_record(nodes + index);
            if (is_instance(node)) {
                const Affine to_group = instance_transform(node);
                floor = top;
                id_offset = node.first_primitive;
                group = {node.first_child, 0x80000000u};
                move_to(to_group.point(ray.o), to_group.vector(ray.d));
                continue;
            }
            const uint32_t hits = child_hits(node, box_ray, hit.t);
            group = inner_hits(node, hits, box_ray.order);
            for (CwbvhLeaves leaves = leaf_hits(node, hits); leaves.hits;) {
                const bool met =
                    intersect_primitive<F>(scene, here, shear, take_primitive(leaves), any_hit, hit, id_offset);
                if (any_hit && met) return true;
            }
            if (!(group.hits & kCwbvhInnerBits)) {
                if (top == floor) {
                    floor = -1;
                    id_offset = 0;
                    move_to(ray.o, ray.d);
                }
                if (top == 0) break;
                group = stack[--top];
            }
        }
        return hit.prim != kNone;
    }
};

/// What a device needs: upload both arrays and make_tracer() from the copies.
struct CwbvhArrays {
    std::vector<CwbvhNode> nodes;
    std::vector<CwbvhPrimitive> primitives;
    uint32_t depth = 0;  ///< levels of nodes; at most kCwbvhStackSize
    uint64_t bytes() const { return nodes.size() * sizeof(CwbvhNode) + primitives.size() * sizeof(CwbvhPrimitive); }
};

inline CwbvhTracer make_tracer(const CwbvhNode* nodes, const CwbvhPrimitive* primitives) { return {nodes, primitives}; }

/// Primitive `prim` as leaves hold it.
AMBILUX_HD CwbvhPrimitive make_cwbvh_primitive(const SceneView& scene, uint32_t prim) {
    CwbvhPrimitive p = {};
    p.word = prim | (material_of(scene, prim).lets_pass() ? CwbvhPrimitive::kLetsPass : 0);
    if (scene.is_triangle(prim)) {
        const Triangle t = scene.triangles[prim];
        p.v0 = scene.vertices[t.v0].p, p.v1 = scene.vertices[t.v1].p, p.v2 = scene.vertices[t.v2].p;
        const Vec3f normal = detail::accurate_cross(p.v1 - p.v0, p.v2 - p.v0);
        p.normal_x = normal.x, p.normal_y = normal.y;
    }
    return p;
}

/// Collapses a binary tree into a wide one of least expected cost (Ylitie et al. 2017, section 5.1), with children in
/// the slots that make octant order the order along rays (section 3.2). Instances become nodes whose `root` is their
/// group + 1. Throws Error(device) if the tree is deeper than the traversal stack.
CwbvhArrays collapse_bvh2(const SceneView& scene, const Bvh2& bvh);

/// The tree over everything and those of all groups, one behind the other.
CwbvhArrays build_cwbvh(const SceneView& scene);

/// The structure over a scene, built on the host.
class CwbvhAccel {
public:
    explicit CwbvhAccel(const Scene& scene);

    CwbvhTracer tracer() const { return make_tracer(arrays_.nodes.data(), arrays_.primitives.data()); }
    CwbvhTracer view() const { return tracer(); }
    const CwbvhArrays& arrays() const { return arrays_; }
    uint64_t memory_bytes() const { return arrays_.bytes(); }
    double build_seconds() const { return build_seconds_; }

protected:
    CwbvhAccel() = default;

    CwbvhArrays arrays_;
    double build_seconds_ = 0;
};

}  // namespace ambilux
