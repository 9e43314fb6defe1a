// Directional area emitter: every point of its shape sends light along the geometric normal and nowhere else (Mitsuba
// 3's directionalarea). Light subpaths alone carry it: no ray leaves in exactly that direction by chance, and towards a
// given point none need leave at all. A mask takes nothing from it, as from an area emitter.
#pragma once

#include "transport/emitter/area.h"

namespace ambilux {

template <>
struct EmitterFunctions<DirectionalAreaEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView&, const Emitter&, Vec3f, Vec3f, EmitterSample&) {
        return false;
    }
    /// Starts where rays off the surface do. For what follows there is no surface: nobody sees this emitter, and no ray
    /// finds it.
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView& view, const Emitter& e, Vec3f u, Vec2f, EmissionSample& s) {
        const SurfacePoint point = area_sample_point<F>(view, e, u.z, {u.x, u.y});
        s.d = point.ng;
        s.p = offset_ray_origin(point.p, point.p_error, point.ng, s.d);
        s.radiance = area_radiance<F>(view, e, point.uv, area_opacity<F>(view, e, point.uv));
        s.pdf_pos = area_pdf_position(view, e, point.prim);
        s.pdf_dir = 1.0f;
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter&, Vec3f, Vec3f) {
        return 1.0f;
    }
};

}  // namespace ambilux
