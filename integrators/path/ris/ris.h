// connect by resampled importance sampling (Talbot, Cline and Egbert 2005, "Importance Resampling for Global
// Illumination"): an eye vertex draws M emitter samples x_i of density p and keeps one, y, with a chance in proportion
// to w_i = p_hat(x_i) / p(x_i). With p_hat the unshadowed light, f L V / p_hat(y) * (w_1 + ... + w_M) / M has the
// expectation of one plain sample, and less variance where lights differ more in what they bring here than in their
// power. Weights against hits are those of the plain sample: they depend on y alone, so they still sum to one per path.
#pragma once

#include "integrators/path/ris/settings.h"
#include "stages/eye_vertex.h"

namespace ambilux {

/// An emitter sample and how the vertex scatters its light.
struct LightCandidate {
    EmitterSample light;
    BsdfValue f;
};

/// Keeps one of the candidates that it is shown, in proportion to their weights, with one random number in [0,1).
struct Reservoir {
    LightCandidate kept;
    float target = 0.0f;  ///< p_hat of `kept`
    float sum = 0.0f;     ///< of all weights
    float u;

    AMBILUX_HD void show(const LightCandidate& c, float c_target, float weight) {
        sum += weight;
        const float chance = weight / sum;
        if (u < chance) {
            kept = c;
            target = c_target;
            u /= chance;
        } else {
            u = (u - chance) / (1.0f - chance);
        }
    }
};

/// At an eye vertex, in the place of NextEvent. `Out` takes candidates.
template <Features F, class Mis, class Out>
struct ResampledNextEvent {
    Out candidates;
    StageRecord* record;
    bool seeds;  ///< shadow rays need a seed
    RisSettings settings;

    AMBILUX_HD void at(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v, const Subpath<Mis>& path,
                       uint32_t slot, const NumbersOf<Mis>& numbers) const {
        Candidate<Mis> c;
        if (resample(scene, rules, v, path, numbers, c) && is_valid_radiance(c.value, record))
            candidates.push(pack_candidate(c, slot, seeds ? numbers.shadow_seed(path.depth) : 0));
    }

private:
    /// Blocks of random numbers beyond those of RandomNumbers.
    static constexpr uint32_t kFirstBlock = 0x20000u;

    AMBILUX_HD bool resample(const SceneView& scene, const Rules<Mis>& rules, const Vertex<Mis>& v,
                             const Subpath<Mis>& path, const NumbersOf<Mis>& numbers, Candidate<Mis>& c) const {
        if (!rules.next_event) return false;
        const Receiver receiver = {v.point.p, v.point.ng};
        Reservoir reservoir{};
        reservoir.u = numbers.next_event(path.depth).x;
        const uint32_t first_block = kFirstBlock + path.depth * RisSettings::kMostCandidates;
        for (uint32_t i = 0; i < settings.candidates; ++i) {
            LightCandidate x;
            // The target needs the radiance of environments now, not once the way is known to be free.
            const Vec4f u = numbers.emitter_of_several(first_block, i, settings.candidates);
            if (!sample_emitter_direct<F>(scene, rules.lights, receiver, u, x.light) ||
                !may_scatter(v.scattering, x.light.wi))
                continue;
            x.f = rules.directions.template evaluate<F>(v, x.light.wi, TransportMode::radiance);
            if (is_zero(x.f.value) || !is_valid_radiance(x.f.value * (x.light.radiance / x.light.pdf_sa), record))
                continue;
            const float target = luminance(x.f.value * x.light.radiance), weight = target / x.light.pdf_sa;
            if (weight > 0.0f && weight < kInfinity) reservoir.show(x, target, weight);
        }
        if (!(reservoir.target > 0.0f)) return false;
        const LightCandidate& y = reservoir.kept;
        const float scale = reservoir.sum / (float(settings.candidates) * reservoir.target);
        c.value = path.throughput * y.f.value * (y.light.radiance * scale);
        const float over_power = rules.lights.over_power(scene, receiver, y.light.emitter, y.light.prim);
        c.environment = false;  // its radiance is in the value
        if (is_zero(c.value)) return false;
        return complete_next_event<F>(scene, rules, v, path.depth, over_power, y.light, y.f, c);
    }
};

}  // namespace ambilux
