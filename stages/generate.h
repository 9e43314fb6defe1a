// generate: one camera ray per slot.
#pragma once

#include "items/path_items.h"
#include "queues/wave.h"
#include "stages/path_policy.h"
#include "stages/stage.h"
#include "transport/sensor/camera.h"
#include "transport/sensor/filter.h"

namespace ambilux {

/// Ray of the camera that a path starts with.
AMBILUX_HD CameraSample camera_sample(const SceneView& scene, const Wave& wave, const PathSlot& p) {
    const Vec4f u = random_floats(wave.key(p), kCameraBlock);
    return sample_camera_ray(scene.sensor, sample_film_position(scene, p.x, p.y, {u.x, u.y}), {u.z, u.w});
}

struct Generate {
    SceneView scene;
    Wave wave;
    PathPolicy policy;
    Queue<RayItem> rays;
    Lane* samples;  ///< value of each slot
    StageRecord* record;

    AMBILUX_HD void operator()(uint32_t slot) const {
        RayItem ray;
        if (make(slot, ray)) rays.push(ray);
    }
    /// False if the slot has none.
    AMBILUX_HD bool make(uint32_t slot, RayItem& ray) const {
        samples[slot] = {};
        const PathSlot p = wave.locate(slot);
        if (!p.active || policy.max_depth == 0) return false;
        const CameraSample c = camera_sample(scene, wave, p);
        ray = {c.o, slot, c.d, WalkBits::make(1, true, 1.0f), {1.0f, 1.0f, 1.0f}, c.tmax};
        return true;
    }
};

}  // namespace ambilux
