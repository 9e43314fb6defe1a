// Rays in double precision: a binary tree of boxes and textbook tests, independent of what the renderers trace with.
#pragma once

#include <vector>

#include "render/twin/in_double/scene/ray.h"

namespace ambilux::twin {

class Tracer {
public:
    /// `scene` must not change. Boxes are split at the median of their primitives' centres.
    explicit Tracer(const SceneView& scene);

    /// Nearest surface that the ray meets; prim is kNone for a miss.
    Hit closest(const Ray& ray) const;
    bool occluded(const Ray& ray) const;
    uint64_t memory_bytes() const { return nodes_.size() * sizeof(Node) + prims_.size() * sizeof(uint32_t); }

private:
    struct Node {
        Vec3f lower, upper;
        uint32_t first, count;  ///< leaf: primitives; inner (count 0): its second child, the first follows it
    };
    struct Centre {
        uint32_t prim;
        Vec3f p;
    };

    void build(std::vector<Centre>& centres, uint32_t first, uint32_t last);
    bool trace(const Ray& ray, bool any, Hit& hit) const;

    SceneView scene_;
    std::vector<Node> nodes_;
    std::vector<uint32_t> prims_;
};

}  // namespace ambilux::twin
