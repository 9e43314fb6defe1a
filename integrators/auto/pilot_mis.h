// Sums of the pilot: those of three sets of strategies travel along one subpath (docs/theory.md, section 11).
#pragma once

#include "transport/mis/bidirectional.h"

namespace ambilux {

struct PilotMis {
    /// Hits and next event estimation; light tracing besides; connections besides. The rest follows by differences,
    /// since the sums of the balance heuristic are linear in the densities.
    static constexpr uint32_t kSets = 3;
    static constexpr bool kBidirectional = true;
    struct Sums {
        MisSums of[kSets];
    };
    using Start = SubpathStart;
    using Directions = BsdfDirections;
    using Lights = LightsByPower;
    using Numbers = RandomNumbers;
    struct Ratio {
        float of[kSets];
    };

    BidirectionalMis sets[kSets];
    float light_subpaths;

    PilotMis() : PilotMis(BidirectionalMis{}) {}
    explicit PilotMis(BidirectionalMis mis) : light_subpaths(mis.light_subpaths) {
        constexpr uint32_t kStrategies[kSets] = {kHitStrategies | kNextEventStrategies,
                                                 kHitStrategies | kNextEventStrategies | kLightStrategies,
                                                 kAllStrategies};
        for (uint32_t m = 0; m < kSets; ++m) {
            sets[m] = mis;
            sets[m].strategies = kStrategies[m];
        }
    }

    bool has(uint32_t bits) const { return kAllStrategies & bits; }
    static constexpr bool counts_last_segment(bool) { return true; }

    template <Features F>
    void start_eye(const SceneView& scene, Vec3f d, Sums& sums, SubpathStart& start) const {
        for (uint32_t m = 0; m < kSets; ++m) sets[m].start_eye<F>(scene, d, sums.of[m], start);
    }
    static void start_light(const EmissionSample& e, SubpathStart& start) { BidirectionalMis::start_light(e, start); }

    template <Features F, class Path>
    Sums sums_at(const SceneView& scene, const Lights& lights, Side side, const Path& path, const Sums& sums,
                 const SurfacePoint& point) const {
        return each<Sums>([&](uint32_t m) { return sets[m].sums_at<F>(scene, lights, side, path, sums.of[m], point); });
    }
    Sums sums_after_scatter(const Sums& s, bool first, bool delta, float pdf_forward_sa, float pdf_reverse_sa,
                            float cos_out) const {
        return each<Sums>([&](uint32_t m) {
            return sets[m].sums_after_scatter(s.of[m], first, delta, pdf_forward_sa, pdf_reverse_sa, cos_out);
        });
    }
    template <Features F, class Path>
    bool hit_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray, uint32_t emitter,
                   const SurfacePoint& light, Ratio& ratio) const {
        for (uint32_t m = 0; m < kSets; ++m)
            sets[m].hit_ratio<F>(scene, lights, path, ray.of[m], emitter, light, ratio.of[m]);
        return true;
    }
    template <Features F, class Path>
    bool escape_ratio(const SceneView& scene, const Lights& lights, const Path& path, const Sums& ray,
                      Ratio& ratio) const {
        for (uint32_t m = 0; m < kSets; ++m) sets[m].escape_ratio<F>(scene, lights, path, ray.of[m], ratio.of[m]);
        return true;
    }
    template <Features F>
    Ratio next_event_ratio(const SceneView& scene, float over_power, const Sums& z, bool first,
                           const EmitterSample& light, const BsdfValue& f, float cos_z) const {
        return each<Ratio>([&](uint32_t m) {
            return sets[m].next_event_ratio<F>(scene, over_power, z.of[m], first, light, f, cos_z);
        });
    }
    /// In multiples of the density of one pair of subpaths: sets without connections have none of theirs.
    Ratio connection_ratio(const Sums& y, bool y_first, const Sums& z, bool z_first,
                           const ConnectionDensities& p) const {
        return each<Ratio>([&](uint32_t m) {
            return sets[m].ratio_behind(y.of[m], y_first, p.y_area, p.y_reverse_sa) +
                   sets[m].ratio_behind(z.of[m], z_first, p.z_area, p.z_reverse_sa);
        });
    }
    template <Features F>
    Ratio camera_ratio(const SceneView& scene, const Sums& y, bool first, const CameraConnection& c, float cos_y,
                       float pdf_reverse_sa) const {
        return each<Ratio>(
            [&](uint32_t m) { return sets[m].camera_ratio<F>(scene, y.of[m], first, c, cos_y, pdf_reverse_sa); });
    }
    template <Features F>
    Ratio visible_emitter_ratio(const SceneView& scene, const CameraConnection& c, float cos_light, float pdf_pos,
                                float opacity) const {
        return each<Ratio>(
            [&](uint32_t m) { return sets[m].visible_emitter_ratio<F>(scene, c, cos_light, pdf_pos, opacity); });
    }

private:
    template <class Result, class Function>
    static Result each(Function f) {
        Result result;
        for (uint32_t m = 0; m < kSets; ++m) result.of[m] = f(m);
        return result;
    }
};

}  // namespace ambilux
