// ambient: where a camera ray met a surface, one ray of a cosine-weighted direction asks whether the sky is seen.
#pragma once

#include "core/sampling.h"
#include "integrators/toy/settings.h"
#include "stages/stage.h"
#include "transport/subpath/vertex.h"

namespace ambilux {

/// `Out` takes candidates.
template <Features F, class Out>
struct Ambient {
    static constexpr const char* kName = "ambient";

    SceneView scene;
    Wave wave;
    ToySettings settings;
    Queue<HitItem<PathRay>> hits;
    Out candidates;
    StageRecord* record;

    const Queue<HitItem<PathRay>>& items() const { return hits; }

    AMBILUX_HD void operator()(uint32_t i) const {
        const HitItem<PathRay> h = hits.load(i);
        const Hit hit = h.hit();
        if (hit.prim == kNone) return;
        const SurfacePoint point = surface_at<F>(scene, hit.prim, hit.u, hit.v);
        const RandomNumbers numbers = {wave.key(h.ray.path)};
        const Vec4f u = numbers.scatter(Side::eye, 1);
        const Vec3f ng = dot(point.ng, h.ray.direction) > 0.0f ? -point.ng : point.ng;
        Candidate<UnidirectionalMis> c{};
        c.direction = frame_from_normal(ng).to_world(square_to_cosine_hemisphere({u.x, u.y}));
        c.origin = offset_ray_origin(point.p, ray_offset(point.p, point.p_error, point.ng), point.ng, c.direction);
        c.tmax = settings.radius > 0.0f ? settings.radius : kInfinity;
        c.value = {1.0f, 1.0f, 1.0f};  // cosine / pi over the density
        c.strategy = Strategy::make(1, 2);
        candidates.push(pack_candidate(c, h.ray.path, F.opacity ? numbers.shadow_seed(1) : 0));
    }
};

}  // namespace ambilux
