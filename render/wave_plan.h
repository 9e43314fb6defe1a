// How waves are planned for the memory that a render may have, by one rule for all integrators and both backends.
#pragma once

#include <functional>

#include "backends/scene_fit.h"
#include "integrators/settings.h"

namespace ambilux {

/// What the setting `memory` counts: on a device, all that is allocated there but for what the driver keeps for itself
/// (its context, kernels and their stacks, graphs); on the CPU, the scene, the acceleration structure, the film and the
/// waves of all threads, but neither what only loading and building take, nor copies of the film on their way to a
/// file.
struct RenderBytes {
    SceneBytes scene;
    uint64_t accel, film, waves;

    uint64_t total() const { return scene.total() + accel + film + waves; }
};

/// The largest of `least` to `most` for which `fits`, which holds for all smaller ones if for one; 0 if for none.
uint32_t largest_that_fits(uint32_t least, uint32_t most, const std::function<bool(uint32_t)>& fits);

/// Throws Error(device) with the bytes of each part of `least`, the smallest render that would work, which are more
/// than settings.memory.
[[noreturn]] void refuse_budget(const RenderSettings& settings, const RenderBytes& least);

}  // namespace ambilux
