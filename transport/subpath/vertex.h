// Vertices of subpaths.
#pragma once

#include "transport/scattering.h"
#include "transport/subpath/rules.h"

namespace ambilux {

/// A surface point met by a subpath.
template <class Mis>
struct Vertex {
    SurfacePoint point;  ///< of a vertex that comes from a queue: p and ng only
    float offset;        ///< ray_offset
    Scattering scattering;
    typename Mis::Sums sums;
    bool first;  ///< met by the first ray of its subpath
};

/// An end of a connection: the vertex at the end of `depth` segments, and the throughput of its subpath up to there.
template <class Mis>
struct SubpathEnd {
    Vertex<Mis> vertex;
    Rgb throughput;
    uint32_t depth;
};

/// The vertex `point` that the ray of `path` met, which has `sums` there.
template <Features F, class Mis>
AMBILUX_HD Vertex<Mis> vertex_with(const SceneView& scene, Vec3f direction, uint32_t depth, const SurfacePoint& point,
                                   const typename Mis::Sums& sums) {
    Vertex<Mis> v;
    v.point = point;
    v.offset = ray_offset(point.p, point.p_error, point.ng);
    v.scattering = make_scattering<F>(scene, point, -direction);
    v.sums = sums;
    v.first = depth == 1;
    return v;
}
template <Features F, class Mis>
AMBILUX_HD Vertex<Mis> vertex_at(const SceneView& scene, const Rules<Mis>& rules, Side side, const Subpath<Mis>& path,
                                 const SurfacePoint& point) {
    return vertex_with<F, Mis>(scene, path.direction, path.depth, point,
                               rules.mis.template sums_at<F>(scene, rules.lights, side, path, path.sums, point));
}

/// True if the point that lies `to` from `x` lies in the plane of its surface, as far as positions are known: no higher
/// than where rays begin. Such points exchange no light.
template <class Mis>
AMBILUX_HD bool in_plane(const Vertex<Mis>& x, Vec3f to) {
    return fabsf(dot(x.point.ng, to)) <= x.offset;
}

/// Sets the segment from `from` to the point `to`, both ends moved off their surfaces by their errors, so that it is
/// open at either end. False if nothing lies between them.
template <class Mis>
AMBILUX_HD bool set_segment(Candidate<Mis>& c, const Vertex<Mis>& from, Vec3f wi, Vec3f to, float to_offset,
                            Vec3f to_ng) {
    c.origin = offset_ray_origin(from.point.p, from.offset, from.point.ng, wi);
    const Vec3f segment = offset_ray_origin(to, to_offset, to_ng, -wi) - c.origin;
    const float distance = length(segment);
    if (!(distance > 0.0f)) return false;
    c.direction = segment / distance;
    c.tmax = distance * (1.0f - gamma_bound(8));
    return true;
}

}  // namespace ambilux
