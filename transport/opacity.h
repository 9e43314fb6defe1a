// Opacity of surfaces behind a mask: the chance that a ray meets them.
#pragma once

#include "transport/texture.h"

namespace ambilux {

/// Chance that a ray meets a surface of `material` at texture coordinates `uv`, in [0,1].
template <Features F>
AMBILUX_HD float surface_opacity(const SceneView& scene, const Material& material, Vec2f uv) {
    return clamp(eval_float<F>(scene, material.opacity, uv), 0.0f, 1.0f);
}

/// The chance to the last bit with which hash_float lets a ray meet a surface of opacity > 0.
AMBILUX_HD float hit_chance(float opacity) { return max(ceilf(opacity * 0x1p24f), 1.0f) * 0x1p-24f; }

/// Steps in which weights know the opacity of an emitter: a byte beside its number in the start of a light subpath. All
/// strategies of a path see the same step, so that weights sum to one; the least one of a surface is not 0.
constexpr uint32_t kOpacitySteps = 255;
AMBILUX_HD uint32_t opacity_step(float opacity) {
    return uint32_t(clamp(ceilf(opacity * float(kOpacitySteps)), 1.0f, float(kOpacitySteps)));
}
AMBILUX_HD float step_opacity(uint32_t step) { return float(step) / float(kOpacitySteps); }
AMBILUX_HD float weight_opacity(float opacity) { return step_opacity(opacity_step(opacity)); }

}  // namespace ambilux
