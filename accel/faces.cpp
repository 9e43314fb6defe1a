#include "accel/faces.h"

#include "core/parallel.h"
#include "scene/surface.h"

namespace ambilux {

Faces::Faces(const Scene& scene) {
    if (scene.features.bumps) return;  // they ask for dpdv too
    faces_.resize(scene.triangles.size());
    const SceneView view = scene.view();
    parallel_for(
        uint32_t(faces_.size()),
        [&](uint32_t i) {
            const Triangle tri = view.triangles[i];
            const SurfacePoint point = detail::triangle_surface_at(view, i, 0.0f, 0.0f);
            const bool flat = !(view.shapes[tri.shape].flags & kShapeHasNormals);
            faces_[i] = {view.vertices[tri.v0].p,
                         view.vertices[tri.v1].p,
                         view.vertices[tri.v2].p,
                         point.ng,
                         flat ? frame_from_normal_tangent(point.ng, point.dpdu).s : point.dpdu,
                         tri.shape};
        },
        1024u);
}

}  // namespace ambilux
