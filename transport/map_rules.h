// What Mitsuba 3.7 and later do besides to surfaces with bump or normal maps. Two rules, each of which a file can turn
// off:
// - a normal that faces away from the camera's side is turned about the shading normal without the map (as Schuessler
// et
//   al. 2017, "Microfacet-based Normal Mapping for Robust Monte Carlo Path Tracing", do for one of theirs);
// - light that grazes the surface is darkened (Conty Estevez et al. 2019, "A Microfacet-Based Shadowing Function to
// Solve
//   the Bump Terminator Problem").
// Both treat the two directions in different ways: `camera` is the one that leads to the camera, `light` the other one.
// Subpaths from light and from the camera so use the same function; what differs are densities.
#pragma once

#include "transport/frame_scattering.h"

namespace ambilux {

/// Turned by half a turn about the normal without the map.
AMBILUX_HD Vec3f turned(Vec3f v, Vec3f base) { return base * (2.0f * dot(v, base)) - v; }
AMBILUX_HD Frame turned(const Frame& f, Vec3f base) {
    return {turned(f.s, base), turned(f.t, base), turned(f.n, base)};
}

/// `s` in the frame that the camera sees, and whether that is the turned one.
AMBILUX_HD bool turns_for(const Scattering& s, Vec3f camera) {
    return s.map_rules & kTurnNormals && !(dot(camera, s.frame.n) * dot(camera, s.base) > 0.0f);
}
AMBILUX_HD Scattering in_frame(const Scattering& s, bool turn) {
    Scattering t = s;
    if (turn) {
        t.frame = turned(s.frame, s.base);
        t.wi = t.frame.to_local(s.wi_world);
    }
    return t;
}

/// Share of light that is not shadowed by bumps, for a frame with normal `n`.
AMBILUX_HD float bump_shadowing(const Scattering& s, Vec3f light) {
    if (!(s.map_rules & kShadowBumps)) return 1.0f;
    const auto tan2 = [&](Vec3f w) {
        const float cos2 = sqr(dot(w, s.base));
        return max(1.0f - cos2, 0.0f) / max(cos2, 0x1p-60f);
    };
    return 2.0f / (1.0f + sqrtf(1.0f + min(0.125f * tan2(s.frame.n), 1.0f) * tan2(light)));
}

/// Frames in which a subpath from light may go on: those that face where it came from.
struct LightFrames {
    bool straight, turned;

    AMBILUX_HD float chance() const { return straight && turned ? 0.5f : 1.0f; }
};
AMBILUX_HD LightFrames light_frames(const Scattering& s, Vec3f light) {
    const auto faces = [&](Vec3f n) { return sides_agree(s, light, dot(n, light)); };
    return {faces(s.frame.n), (s.map_rules & kTurnNormals) && faces(turned(s.frame.n, s.base))};
}

/// Density of sampling `camera` where light arrives from `light`.
template <Features F>
AMBILUX_HD float light_density(const Scattering& s, Vec3f light, Vec3f camera) {
    const LightFrames frames = light_frames(s, light);
    float sum = 0.0f;
    for (int turn = 0; turn < 2; ++turn) {
        if (!(turn ? frames.turned : frames.straight)) continue;
        const Frame f = turn ? turned(s.frame, s.base) : s.frame;
        sum += bsdf_pdf<F>(s.bsdf, f.to_local(light), f.to_local(camera), TransportMode::importance);
    }
    return sum * frames.chance();
}

/// scatter_evaluate of a surface with rules.
template <Features F>
AMBILUX_HD BsdfValue mapped_evaluate(const Scattering& s, Vec3f wo_world, TransportMode mode) {
    const bool to_light = mode == TransportMode::radiance;
    const Vec3f camera = to_light ? s.wi_world : wo_world, light = to_light ? wo_world : s.wi_world;
    BsdfValue v = evaluate_in_frame<F>(in_frame(s, turns_for(s, camera)), wo_world, mode);
    if (is_zero(v.value)) return no_scattering();
    v.value *= bump_shadowing(s, light);
    if (s.map_rules & kTurnNormals) (to_light ? v.pdf_reverse_sa : v.pdf_sa) = light_density<F>(s, light, camera);
    return v;
}

/// scatter_sample of a surface with rules.
template <Features F>
AMBILUX_HD bool mapped_sample(const Scattering& s, Vec3f u, TransportMode mode, ScatterSample& out) {
    bool turn = false;
    float chance = 1.0f;
    if (mode == TransportMode::radiance) {
        turn = turns_for(s, s.wi_world);
    } else {
        const LightFrames frames = light_frames(s, s.wi_world);
        turn = !frames.straight;
        chance = frames.chance();
        if (chance < 1.0f) {
            turn = u.x >= 0.5f;
            u.x = min(2.0f * u.x - (turn ? 1.0f : 0.0f), kOneMinusEpsilon);
        }
    }
    if (!sample_in_frame<F>(in_frame(s, turn), u, mode, out)) return false;
    if (!(out.flags & kScatterDelta)) {
        const BsdfValue v = mapped_evaluate<F>(s, out.wo, mode);
        return smooth_sample(out.wo, v, out.eta, out.flags, out);
    }
    const bool to_light = mode == TransportMode::radiance;
    if (!to_light && turns_for(s, out.wo) != turn) return false;  // the camera sees the other frame there
    out.pdf_sa *= chance;
    out.weight *= bump_shadowing(s, to_light ? out.wo : s.wi_world) / chance;
    return true;
}

}  // namespace ambilux
