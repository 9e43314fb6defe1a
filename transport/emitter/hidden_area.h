// Hidden area emitter, pbrt-v4's area light of alpha 0: lights the scene as an area emitter does, and no ray meets it.
// To all strategies it is a point emitter whose place, and with it the intensity radiance · area · cosine, is drawn
// anew for each sample: the density of the place is the same for all of them and cancels in the weights.
#pragma once

#include "transport/emitter/area.h"

namespace ambilux {

/// Intensity over the cosine of a point of the emitter: the place is in it.
template <Features F>
AMBILUX_HD Rgb hidden_area_intensity(const SceneView& view, const Emitter& e, const SurfacePoint& point) {
    return eval_rgb<F>(view, e.radiance, point.uv) * (1.0f / area_pdf_position(view, e, point.prim));
}

template <>
struct EmitterFunctions<HiddenAreaEmitter> {
    template <Features F>
    AMBILUX_HD static bool sample_direct(const SceneView& view, const Emitter& e, Vec3f reference_p, Vec3f u,
                                         EmitterSample& s) {
        const SurfacePoint point = area_sample_point<F>(view, e, u.z, {u.x, u.y});
        const LightGeometry light = light_from_point(point, reference_p, s);
        if (!(light.cosine > 0.0f)) return false;
        s.delta = true;
        s.radiance = hidden_area_intensity<F>(view, e, point) * (light.cosine / light.distance2);
        s.pdf_sa = e.pick_probability;
        return true;
    }
    /// Starts where rays off the surface do. For what follows there is no surface.
    template <Features F>
    AMBILUX_HD static void sample_emission(const SceneView& view, const Emitter& e, Vec3f u, Vec2f u_direction,
                                           EmissionSample& s) {
        const SurfacePoint point = area_sample_point<F>(view, e, u.z, {u.x, u.y});
        const Vec3f local = square_to_cosine_hemisphere(u_direction);
        s.d = frame_from_normal(point.ng).to_world(local);
        s.p = offset_ray_origin(point.p, point.p_error, point.ng, s.d);
        s.cos_theta = local.z;
        s.radiance = hidden_area_intensity<F>(view, e, point);
        s.pdf_dir = local.z * kInvPi;
    }
    template <Features F>
    AMBILUX_HD static float pdf_emission_direction(const SceneView&, const Emitter&, Vec3f ng, Vec3f d) {
        return max(dot(ng, d), 0.0f) * kInvPi;
    }
};

}  // namespace ambilux
