// A render against the image that was published with its scene.
#pragma once

#include "film/exr_io.h"
#include "film/metrics.h"
#include "tests/support/render_scene.h"

namespace ambilux {

/// Requires that the mean agrees within 1 % and 95 % of the blocks of `block` x `block` pixels within 3 %, at the
/// resolution of the published image: both renderers use a tent of one pixel, which at any other size blurs edges
/// differently.
///
/// Below a thousandth of the image mean, differences count against that instead: the published images are half floats,
/// whose steps are coarse there, and radiance in the far tails of a lobe is what their samples happened to find.
inline void require_published_image(const std::string& name, int max_depth, uint32_t spp, uint32_t block) {
    const auto file = published_file("scenes/" + name + "/TungstenRender.exr");
    if (!file) return;
    Image reference = read_exr(*file);
    const auto scene = published_scene(name, reference.width, reference.height);
    RenderSettings settings = cpu_settings(*scene, Estimator::mis);
    settings.max_depth = max_depth;
    const RenderResult result = render_scene(*scene, settings, spp);
    CHECK(result.stats.invalid.total() == 0);

    Image image = mean_image(result.film);
    const BlockAgreement whole = block_agreement(image, reference, block);
    double mean = 0;
    for (const float v : reference.rgb) mean += v / double(reference.rgb.size());
    const float floor = float(1e-3 * mean);
    for (Image* i : {&image, &reference})
        for (float& v : i->rgb) v += floor;
    const BlockAgreement blocks = block_agreement(image, reference, block);
    UNSCOPED_INFO(name << ": mean " << whole.relative_mean << ", blocks within 3 % " << blocks.within << ", worst "
                       << blocks.worst << " at (" << blocks.worst_x << ", " << blocks.worst_y << ")");
    CHECK(std::abs(whole.relative_mean) < 0.01);
    CHECK(blocks.within >= 0.95);
}

}  // namespace ambilux
