// generate: the first ray of each slot's subpath.
#pragma once

#include "stages/stage.h"
#include "stages/subpath_numbers.h"
#include "transport/subpath/start.h"

namespace ambilux {

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
        float tmax;
        const Subpath<Mis> path = start_eye_subpath<F>(scene, mis, p.x, p.y, eye_numbers(mis, wave, p), tmax);
        ray = Items::pack(path, Side::eye, slot, tmax);
        return true;
    }
};

/// Where the start of a light subpath goes: what the camera sees of the emitter itself to `splats`.
template <Features F, class Mis, class Out>
struct LightStartSink {
    const Out& splats;
    uint32_t slot;
    const NumbersOf<Mis>& numbers;
    StageRecord* record;

    AMBILUX_HD bool valid(Rgb flux) const { return is_valid_radiance(flux, record); }
    AMBILUX_HD void add(const Candidate<Mis>& c) const {
        if (is_valid_radiance(c.value, record))
            splats.push(pack_candidate(c, slot, F.opacity ? numbers.shadow_seed(0) : 0));
    }
};

/// A light subpath in each slot that has one in this round. `Out` takes splat candidates.
template <Features F, class Mis, class Out>
struct GenerateLight {
    static constexpr const char* kName = "light_generate";
    using Items = SubpathItems<Mis>;

    SceneView scene;
    Wave wave;
    Rules<Mis> rules;
    Queue<typename Items::Ray> rays;
    Out splats;
    uint32_t* last_vertex;  ///< per slot: the last vertex of its light subpath; null if nobody asks
    StageRecord* record;
    uint32_t per_tile;  ///< light subpaths of kTilePixels pixels, in one sample
    uint32_t round = 0;

    AMBILUX_HD void operator()(uint32_t slot) const {
        if (last_vertex) last_vertex[slot] = kNone;
        if (round >= light_subpaths_of(slot, per_tile) || !wave.locate(slot).active) return;
        const NumbersOf<Mis> numbers = light_numbers(rules.mis, wave, slot);
        EmissionSample e;
        Subpath<Mis> path;
        if (start_light_subpath<F>(scene, rules, numbers, LightStartSink<F, Mis, Out>{splats, slot, numbers, record}, e,
                                   path))
            rays.push(Items::pack(path, Side::light, slot, kInfinity));
    }
};

}  // namespace ambilux
