// Files of the images of single strategies.
#pragma once

#include <string>

#include "render/renderer.h"

namespace ambilux {

/// Depth of which images are written when nobody says: the rows of a pyramid that still fit a page.
constexpr uint32_t kDefaultTechniqueDepth = 6;

/// Writes raw_sSS_tTT.exr and weighted_sSS_tTT.exr for every strategy into `folder`, which is made (of merges,
/// raw_merge_sSS_tTT.exr and so on), and last of all techniques.json, which lists them: {scene, integrator, variant,
/// spp, max_depth, width, height, entries: [{s, t, merge, raw, weighted, mean_raw, mean_weighted, dropped}]}. Means are
/// over all pixels and channels. Throws Error(device).
void write_technique_images(const std::string& folder, const Scene& scene, const RenderSettings& settings,
                            const RenderStats& stats, const std::vector<StrategyImage>& images);

}  // namespace ambilux
