// What hosts keep of triangles beside their vertices.
#pragma once

#include "scene/scene.h"

namespace ambilux {

/// A Face for each triangle of a scene whose kernels may look them up.
class Faces {
public:
    explicit Faces(const Scene& scene);

    /// For SceneView::faces; null where there are none.
    const Face* data() const { return faces_.empty() ? nullptr : faces_.data(); }
    uint64_t memory_bytes() const { return faces_.size() * sizeof(Face); }

private:
    std::vector<Face> faces_;
};

}  // namespace ambilux
