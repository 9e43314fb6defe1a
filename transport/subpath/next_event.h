// s = 1: an eye vertex samples an emitter (next event estimation).
#pragma once

#include "transport/emitter.h"
#include "transport/subpath/bsdf_directions.h"
#include "transport/subpath/rules.h"
#include "transport/subpath/vertex.h"

namespace ambilux {

/// Completes the candidate of the emitter sample `light`, whose value is known: ratio, strategy and segment.
/// `over_power`: of the emitter's pick (Mis::Lights); `f`: how `z` scatters its light. False if nothing lies between.
template <Features F, class Mis>
AMBILUX_HD bool complete_next_event(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& z,
                                    uint32_t depth, float over_power, const EmitterSample& light, const BsdfValue& f,
                                    Candidate<Mis>& c) {
    const float cos_z = fabsf(dot(z.point.ng, light.wi));
    c.ratio =
        rules.counted(rules.mis.template next_event_ratio<F>(scene, over_power, z.sums, z.first, light, f, cos_z));
    c.strategy = Strategy::make(1, depth + 1);
    if (light.distance < kInfinity)
        return set_segment(c, z, light.wi, light.p, ray_offset(light.p, light.p_error, light.ng), light.ng);
    c.origin = offset_ray_origin(z.point.p, z.offset, z.point.ng, light.wi);
    c.direction = light.wi;
    c.tmax = kInfinity;
    return true;
}

/// What the emitter sample `light` brings to an eye subpath of `throughput` whose BSDF has the value `f` for it; of an
/// environment without its radiance (sample_emitter_deferred).
AMBILUX_HD Rgb next_event_value(Rgb throughput, const BsdfValue& f, const EmitterSample& light, bool environment) {
    return throughput * f.value * ((environment ? splat(1.0f) : light.radiance) / light.pdf_sa);
}

/// The vertex `z` of an eye subpath of `depth` segments and `throughput` up to there samples an emitter with `u`. False
/// if that gives nothing.
template <Features F, class Mis>
AMBILUX_HD bool next_event(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& z, Rgb throughput,
                           uint32_t depth, Vec4f u, Candidate<Mis>& c) {
    EmitterSample light;
    typename Mis::Lights::Pick pick;
    if (!rules.next_event || !rules.wants(1, depth + 1)) return false;
    if (!sample_emitter_deferred<F>(scene, rules.lights, {z.point.p, z.point.ng}, u, light, pick) ||
        !may_scatter(z.scattering, light.wi))
        return false;
    const BsdfValue f = rules.directions.template evaluate<F>(z, light.wi, TransportMode::radiance);
    if (is_zero(f.value)) return false;
    c.environment = is_environment<F>(scene, light.emitter);
    c.value = next_event_value(throughput, f, light, c.environment);
    if (is_zero(c.value)) return false;  // as a condition of what is returned it costs nvcc ten registers
    return complete_next_event<F>(scene, rules, z, depth, pick.over_power, light, f, c);
}

}  // namespace ambilux
