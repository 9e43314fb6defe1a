// Where a ray is in a CWBVH of two levels (CwbvhTracer::traverse_instances, a step at a time).
#pragma once

#include "accel/cwbvh.h"

namespace ambilux::detail {

/// `Base`: the cursor for one level. Primitives wait in the coordinates of the tree that they are in: the ray enters
/// and leaves a group only when it holds none. Its way in the scene waits on the stack meanwhile.
template <class Base>
struct InstanceCursor : Base {
    using Entry = typename Base::Entry;
    static constexpr int kWay = Base::kEntries, kEntries = Base::kEntries + 3;
    int floor = -1;             ///< of the stack while in a group
    uint32_t entrance = kNone;  ///< an instance that is to be entered
    uint32_t id_offset = 0;

    __device__ void begin(const CwbvhTracer& tracer, Entry* stack) {
        Base::begin(tracer, stack);
        floor = -1;
        entrance = kNone;
        id_offset = 0;
    }
    __device__ bool has_nodes() const { return entrance != kNone || Base::has_nodes(); }
    __device__ bool moves() const {
        return entrance != kNone || (!(this->group.hits & kCwbvhInnerBits) && this->top == floor);
    }
    __device__ bool can_step() const {
        return this->later.hits == 0 && has_nodes() && !(this->leaves.hits != 0 && moves());
    }
    __device__ void step(const CwbvhTracer& tracer, Entry* stack, Ray& ray, CwbvhRay& box_ray, RayShear& shear,
                         float tmax, uint32_t order_mask) {
        if (entrance == kNone && !(this->group.hits & kCwbvhInnerBits)) {
            if (this->top == floor) leave(stack, ray, box_ray, shear);
            this->group = stack[--this->top];
        }
        const uint32_t order = box_ray.order & order_mask;
        uint32_t child = entrance;
        if (child == kNone) {
            child = take_child(this->group, order);
            if (this->group.hits & kCwbvhInnerBits) stack[this->top++] = this->group;
        }
        const CwbvhNode node = load_record(tracer.nodes + child);
        if (is_instance(node)) {
            this->group.hits = 0;
            entrance = child;
            if (this->leaves.hits == 0) enter(node, stack, ray, box_ray, shear);
            return;
        }
        const uint32_t hits = child_hits(node, box_ray, tmax);
        this->group = inner_hits(node, hits, order);
        if (this->leaves.hits)
            this->later = leaf_hits(node, hits);
        else
            this->leaves = leaf_hits(node, hits);
    }
    __device__ void end() {
        Base::end();
        floor = -1;
        entrance = kNone;
    }

private:
    __device__ void enter(const CwbvhNode& node, Entry* stack, Ray& ray, CwbvhRay& box_ray, RayShear& shear) {
        stack[kWay] = {float_bits(ray.o.x), float_bits(ray.o.y)};
        stack[kWay + 1] = {float_bits(ray.o.z), float_bits(ray.d.x)};
        stack[kWay + 2] = {float_bits(ray.d.y), float_bits(ray.d.z)};
        const Affine to_group = instance_transform(node);
        move(ray, box_ray, shear, to_group.point(ray.o), to_group.vector(ray.d));
        floor = this->top;
        entrance = kNone;
        id_offset = node.first_primitive;
        this->group = {node.first_child, 0x80000000u};
    }
    __device__ void leave(const Entry* stack, Ray& ray, CwbvhRay& box_ray, RayShear& shear) {
        const Entry a = stack[kWay], b = stack[kWay + 1], c = stack[kWay + 2];
        move(ray, box_ray, shear, {bits_float(a.base), bits_float(a.hits), bits_float(b.base)},
             {bits_float(b.hits), bits_float(c.base), bits_float(c.hits)});
        floor = -1;
        id_offset = 0;
    }
    static __device__ void move(Ray& ray, CwbvhRay& box_ray, RayShear& shear, Vec3f o, Vec3f d) {
        ray.o = o, ray.d = d;
        box_ray = make_cwbvh_ray(o, d);
        shear = make_ray_shear(d);
    }
};

}  // namespace ambilux::detail
