// What the camera sees besides light: layers for denoisers and for a look at a scene.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "film/layer.h"
#include "integrators/settings.h"
#include "scene/scene.h"

namespace ambilux {

/// Names of the layers that sample_aovs() makes, in this order.
const std::vector<std::string>& aov_names();

/// Traces `samples` camera paths for each pixel, those of an `eye` render with this seed, on the CPU.
///
/// albedo: share of light that the first surface that is no mirror and no glass scatters towards the path, seen through
/// what lies before it; an estimate by one direction a path, within [0,1]. normal: that surface's shading normal, unit
/// length or shorter where normals vary within the pixel. depth, position: distance to the first surface, whatever it
/// is, and its place in the world; means over the paths that meet one. What sees nothing is 0 in all layers.
std::vector<Layer> sample_aovs(const Scene& scene, const RenderSettings& settings, uint32_t samples);

}  // namespace ambilux
