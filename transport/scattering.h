// A surface point that is ready to scatter: which BSDF, in which frame, and what normals allow. Knows types of BSDFs,
// not their formulas.
#pragma once

#include "scene/surface.h"
#include "transport/blend.h"
#include "transport/bsdf/sample.h"
#include "transport/resolve_bsdf.h"

namespace ambilux {

/// A surface point ready to scatter light that arrived along -wi_world.
struct Scattering {
    Frame frame;     ///< shading frame of the BSDF, bump or normal map applied; n points to the side of the ray when
                     ///< `flipped`
    Vec3f ng;        ///< unit geometric normal, flipped with frame.n
    Vec3f wi_world;  ///< unit, to where the subpath came from
    Vec3f wi;        ///< the same in `frame`
    Bsdf bsdf;
    uint32_t record;     ///< place of its BsdfRecord in SceneView::bsdfs
    bool flipped;        ///< two-sided material met from behind: frame.n, base and ng are negated
    uint32_t map_rules;  ///< MapRules: of the record; 0 where kernels know none
    Vec3f base;          ///< with map_rules: unit, the shading normal without the map

    /// All of it is reflectance and normals.
    AMBILUX_HD bool plain_diffuse() const { return bsdf.type == BsdfType::diffuse && !bsdf.coat && !map_rules; }
};

/// Result of scatter_sample: a BsdfSample whose wo is in world space.
using ScatterSample = BsdfSample;

/// Shading normal of `record` at `point`: from its normal map or bump map, or the point's own. World space, unit.
/// Normal map: texel·2-1 in the frame (dpdu, n×dpdu, n). Bump map: normal of the surface displaced along ns by
/// bump_scale·texture, to first order (Blinn 1978; Mitsuba's bumpmap), on the side of ng.
template <Features F>
AMBILUX_HD Vec3f perturbed_normal(const SceneView& scene, const BsdfRecord& record, const SurfacePoint& point) {
    Vec3f n = point.ns;
    if (record.normal_map >= 0) {
        const Rgb texel = eval_texture<F>(scene, scene.textures[record.normal_map], point.uv);
        n = frame_from_normal_tangent(point.ns, point.dpdu).to_world(texel * 2.0f - splat(1.0f));
    } else if (record.bump_map >= 0) {
        const Vec2f g =
            texture_height_gradient<F>(scene, scene.textures[record.bump_map], point.uv) * record.bump_scale;
        const Vec3f du = point.dpdu + n * (g.x - dot(n, point.dpdu)), dv = point.dpdv + n * (g.y - dot(n, point.dpdv));
        n = cross(du, dv);
        if (dot(n, point.ng) < 0.0f) n = -n;
    }
    const float l2 = length_squared(n);
    // Degenerate maps and parametrisations leave the normal as it is.
    return l2 > 0.0f && l2 < kInfinity ? n * inverse_sqrt(l2) : point.ns;
}

/// Frame of scattering at `point` with the shading normal `n`.
AMBILUX_HD Frame scattering_frame(const SurfacePoint& point, Vec3f n) {
    return point.framed ? Frame{point.dpdu, cross(n, point.dpdu), n} : frame_from_normal_tangent(n, point.dpdu);
}

/// Prepares scattering of a subpath that arrived from unit direction `wi_world` (pointing away from the surface). The
/// side is that of the geometric normal: where the shading normal disagrees, nothing is scattered at all.
template <Features F>
AMBILUX_HD Scattering make_scattering(const SceneView& scene, const SurfacePoint& point, Vec3f wi_world) {
    const Material& material = material_at<F>(scene, point);
    const bool flip = material.two_sided != 0 && dot(point.ng, wi_world) < 0.0f;
    const uint32_t index = flip ? material.back : material.front;
    const BsdfRecord& record = scene.bsdfs[index];
    Vec3f n = point.ns;
    if constexpr (F.bumps) n = perturbed_normal<F>(scene, record, point);
    Scattering s;
    s.frame = scattering_frame(point, n);
    s.ng = point.ng;
    if (flip) {
        s.frame.n = -s.frame.n;
        s.ng = -s.ng;
    }
    s.wi_world = wi_world;
    s.wi = s.frame.to_local(wi_world);
    s.bsdf = resolve_bsdf<F>(scene, record, point.uv);
    s.record = index;
    s.flipped = flip;
    s.map_rules = 0;
    if constexpr (F.map_rules) {
        s.map_rules = record.map_rules;
        s.base = flip ? -point.ns : point.ns;
    }
    return s;
}

/// What is left of a Scattering when its point is forgotten: scattering_of() makes it again.
struct ScatteringParts {
    Vec3f ng, n;      ///< of Scattering::ng and frame.n
    Vec3f tangent;    ///< frame.s; with map_rules packed_base()
    uint32_t record;  ///< and, in the highest bit, whether it was flipped
    BsdfInputs inputs;
};

/// Across `n`, as near as can be to a tangent of `base`, which unpack_base() finds again.
AMBILUX_HD Frame frame_beside(Vec3f n, Vec3f base) { return frame_from_normal_tangent(n, frame_from_normal(base).s); }

/// Scattering::base and the angle of frame.s about frame.n.
AMBILUX_HD Vec3f packed_base(const Scattering& s) {
    const Vec2f base = octahedral_encode(s.base);
    const Frame f = frame_beside(s.frame.n, octahedral_decode(base));
    return {base.x, base.y, atan2f(dot(s.frame.s, f.t), dot(s.frame.s, f.s))};
}
AMBILUX_HD void unpack_base(Vec3f packed, Vec3f n, Vec3f& base, Vec3f& tangent) {
    base = octahedral_decode({packed.x, packed.y});
    const Frame f = frame_beside(n, base);
    float sine, cosine;
    sin_cos_turns(packed.z * kInv2Pi, sine, cosine);
    tangent = f.s * cosine + f.t * sine;
}

AMBILUX_HD ScatteringParts parts_of(const Scattering& s) {
    return {s.ng, s.frame.n, s.map_rules ? packed_base(s) : s.frame.s, s.record | uint32_t(s.flipped) << 31,
            s.bsdf.inputs};
}

/// All but the BSDF.
template <Features F>
AMBILUX_HD Scattering frame_of(const SceneView& scene, const ScatteringParts& parts, Vec3f wi_world) {
    Scattering s;
    s.record = parts.record & 0x7fffffffu;
    s.flipped = parts.record >> 31;
    Vec3f tangent = parts.tangent;
    s.map_rules = 0;
    if constexpr (F.map_rules) {
        s.map_rules = scene.bsdfs[s.record].map_rules;
        if (s.map_rules) unpack_base(parts.tangent, parts.n, s.base, tangent);
    }
    s.frame = {tangent, cross(s.flipped ? -parts.n : parts.n, tangent), parts.n};
    s.ng = parts.ng;
    s.wi_world = wi_world;
    s.wi = s.frame.to_local(wi_world);
    return s;
}

template <Features F>
AMBILUX_HD Scattering scattering_of(const SceneView& scene, const ScatteringParts& parts, Vec3f wi_world) {
    Scattering s = frame_of<F>(scene, parts, wi_world);
    const BsdfRecord& record = scene.bsdfs[s.record];
    if constexpr (F.textures)
        s.bsdf = resolve_bsdf<F>(scene, record, parts.inputs);
    else
        s.bsdf = resolve_bsdf<F>(scene, record, Vec2f{});
    return s;
}
/// The same of a diffuse BSDF, which needs no more than the normals and its reflectance: without tangents, side and
/// record.
AMBILUX_HD Scattering diffuse_scattering(const ScatteringParts& parts, Vec3f wi_world) {
    Scattering s = {};
    s.frame.n = parts.n;
    s.ng = parts.ng;
    s.wi_world = wi_world;
    s.wi.z = dot(parts.n, wi_world);
    s.bsdf = bsdf_of(Resolved<Diffuse>{{parts.inputs.colors[0]}, {}});
    return s;
}

/// True if `cos_shading` = dot(frame.n, w) and dot(ng, w) put w on the same side. Directions where they differ carry no
/// light, in either mode and for either direction of a pair: reflection then leaves on the side it came from, and
/// transmission passes through.
AMBILUX_HD bool sides_agree(const Scattering& s, Vec3f w, float cos_shading) {
    const float cos_geometric = dot(s.ng, w);
    return (cos_geometric > 0.0f && cos_shading > 0.0f) || (cos_geometric < 0.0f && cos_shading < 0.0f);
}

/// False if no BSDF of the surface can send light from `wi_world` to `wo_world`, told from its type and the geometry
/// alone: what does not transmit scatters to its own side only.
AMBILUX_HD bool may_scatter(const SceneView& scene, const SurfacePoint& point, Vec3f wi_world, Vec3f wo_world) {
    const float cos_wi = dot(point.ng, wi_world), cos_wo = dot(point.ng, wo_world);
    if (cos_wi * cos_wo > 0.0f) return true;
    const Material& material = scene.materials[scene.shapes[point.shape].material];
    return bsdf_transmits(scene.bsdfs[material.two_sided != 0 && cos_wi < 0.0f ? material.back : material.front].type);
}

/// The same where the BSDF is known.
AMBILUX_HD bool may_scatter(const Scattering& s, Vec3f wo_world) {
    return dot(s.ng, s.wi_world) * dot(s.ng, wo_world) > 0.0f || bsdf_transmits(s.bsdf.type);
}

/// What a BSDF with shading normals is multiplied with in importance mode, |wi·ns|·|wo·ng| / (|wi·ng|·|wo·ns|), so that
/// both modes describe one surface (Veach 1997, equations 5.19 and 5.20); 1 in radiance mode. Cosines are those with
/// the shading normal.
AMBILUX_HD float shading_normal_factor(const Scattering& s, Vec3f wo_world, float cos_wo, TransportMode mode) {
    if (mode == TransportMode::radiance) return 1.0f;
    return fabsf(s.wi.z / dot(s.ng, s.wi_world)) * fabsf(dot(s.ng, wo_world) / cos_wo);
}

}  // namespace ambilux
