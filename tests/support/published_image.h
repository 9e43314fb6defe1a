// A render against the image that was published with its scene.
#pragma once

#include <fmt/format.h>

#include "film/exr_io.h"
#include "film/metrics.h"
#include "tests/support/render_scene.h"

namespace ambilux {

/// Whether the mean agrees within 1 % and 95 % of the blocks of `block` x `block` pixels within 3 %.
///
/// Below a thousandth of the image mean, differences count against that instead: the published images are half floats,
/// whose steps are coarse there, and radiance in the far tails of a lobe is what their samples happened to find.
inline bool agrees(Image image, Image reference, uint32_t block, std::string* report = nullptr) {
    const BlockAgreement whole = block_agreement(image, reference, block);
    double mean = 0;
    for (const float v : reference.rgb) mean += v / double(reference.rgb.size());
    const float floor = float(1e-3 * mean);
    for (Image* i : {&image, &reference})
        for (float& v : i->rgb) v += floor;
    const BlockAgreement blocks = block_agreement(image, reference, block);
    if (report)
        *report = fmt::format("mean {}, blocks within 3 % {}, worst {} at ({}, {})", whole.relative_mean, blocks.within,
                              blocks.worst, blocks.worst_x, blocks.worst_y);
    return std::abs(whole.relative_mean) < 0.01 && blocks.within >= 0.95;
}

/// `image` times `factor` where x lies in every `every`-th column of blocks.
inline Image brighter_columns(Image image, uint32_t block, uint32_t every, float factor) {
    for (uint32_t y = 0; y < image.height; ++y)
        for (uint32_t x = 0; x < image.width; ++x)
            if (x / block % every == 0)
                for (uint32_t c = 0; c < 3; ++c) image.rgb[(size_t(y) * image.width + x) * 3 + c] *= factor;
    return image;
}

/// Requires that a render agrees with its published image, at that resolution: both renderers use a tent of one pixel,
/// which at any other size blurs edges differently. And that it would not, were it 2 % brighter or darker as a whole,
/// or a sixth of it by 10 % and the rest by as much the other way that the mean stays.
inline void require_published_image(const std::string& name, int max_depth, uint32_t spp, uint32_t block) {
    const auto file = published_file("scenes/" + name + "/TungstenRender.exr");
    if (!file) return;
    const Image reference = read_exr(*file);
    const auto scene = published_scene(name, reference.width, reference.height);
    RenderSettings settings = cpu_settings(*scene, Estimator::mis);
    settings.max_depth = max_depth;
    const RenderResult result = render_scene(*scene, settings, spp);
    CHECK(result.stats.invalid.total() == 0);

    const Image image = mean_image(result.film);
    std::string report;
    const bool agreed = agrees(image, reference, block, &report);
    INFO(name << ": " << report);
    CHECK(agreed);
    for (const float factor : {0.98f, 1.02f})
        CHECK_FALSE(agrees(brighter_columns(image, block, 1, factor), reference, block));
    for (const float factor : {0.9f, 1.1f}) {
        Image local = brighter_columns(image, block, 6, factor);
        double before = 0, after = 0;
        for (size_t i = 0; i < image.rgb.size(); ++i) before += image.rgb[i], after += local.rgb[i];
        for (float& v : local.rgb) v *= float(before / after);
        CHECK_FALSE(agrees(local, reference, block));
    }
}

}  // namespace ambilux
