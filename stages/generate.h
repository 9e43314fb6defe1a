// generate: the first ray of each slot's subpath.
#pragma once

#include "stages/stage.h"
#include "transport/sensor/filter.h"
#include "transport/subpath/camera_connection.h"
#include "transport/subpath/start.h"

namespace ambilux {

/// Camera ray of a path.
template <Features F>
AMBILUX_HD CameraSample camera_sample(const SceneView& scene, const PathSlot& p, const Draws& draws) {
    const Vec4f u = draws.camera();
    return sample_camera_ray<F>(scene.sensor, sample_film_position(scene, p.x, p.y, {u.x, u.y}), {u.z, u.w});
}

template <Features F, class Mis>
struct GenerateEye {
    static constexpr const char* kName = "generate";
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Mis mis;
    Queue<typename Items::Ray> rays;
    Lane* samples;  ///< value of each slot
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        typename Items::Ray ray;
        if (make(slot, ray)) rays.push(ray);
    }
    /// False if the slot has no path.
    AMBILUX_HD bool make(uint32_t slot, typename Items::Ray& ray) const {
        samples[slot] = {};
        const PathSlot p = wave.locate(slot);
        if (!p.active) return false;
        const CameraSample c = camera_sample<F>(scene, p, {wave.key(p)});
        ray = Items::pack(start_eye<F>(scene, mis, c), Side::eye, slot, c.tmax);
        return true;
    }
};

/// Starts a light subpath; the first of a path also shows the emitter itself to the camera, by `splats`. False if there
/// is no first ray.
template <Features F, class Out>
AMBILUX_HD bool start_light_subpath(const SceneView& scene, const Rules<BidirectionalMis>& rules, const Draws& draws,
                                    uint32_t slot, const Out& splats, StageRecord* record,
                                    Subpath<BidirectionalMis>& path) {
    EmissionSample e;
    if (!sample_start<F>(scene, draws, e)) return false;
    path = start_light(rules.mis, e);
    if (!is_valid_radiance(path.throughput, record)) return false;
    const Vec4f u = draws.emission_direction();
    Candidate<BidirectionalMis> c;
    if (draws.number == 0 && visible_emitter<F>(scene, rules, e, {u.z, u.w}, c) && is_valid_radiance(c.value, record))
        splats.push(pack_candidate(c, slot, F.opacity ? draws.shadow_seed(0) : 0));
    return rules.max_depth >= 2;
}

/// A light subpath in each slot that has one in this round. `Out` takes splat candidates.
template <Features F, class Out>
struct GenerateLight {
    static constexpr const char* kName = "light_generate";

    SceneView scene;
    Wave wave;
    Rules<BidirectionalMis> rules;
    Queue<SubpathRay> rays;
    Out splats;
    uint32_t* last_vertex;  ///< per slot: the last vertex of its light subpath; null if nobody asks
    StageRecord* record;
    uint32_t per_tile;  ///< light subpaths of kTilePixels pixels, in one sample
    uint32_t round = 0;

    AMBILUX_HD void operator()(uint32_t slot) const {
        if (last_vertex) last_vertex[slot] = kNone;
        if (round >= light_subpaths_of(slot, per_tile) || !wave.locate(slot).active) return;
        Subpath<BidirectionalMis> path;
        if (start_light_subpath<F>(scene, rules, {wave.key(slot, Stream::light)}, slot, splats, record, path))
            rays.push(SubpathItems<BidirectionalMis>::pack(path, Side::light, slot, kInfinity));
    }
};

}  // namespace ambilux
