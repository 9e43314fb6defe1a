// Reconstruction filters by importance sampling: a sample of a pixel is drawn with the filter's density around its centre and counts with weight 1,
// so that pixels stay independent (Ernst et al. 2006, "Filter Importance Sampling"). Filters are separable and positive.
#pragma once

#include "scene/view.h"

namespace ambilux {

/// One coordinate of the offset, in pixels: the inverse cumulative table, linear between its entries.
AMBILUX_HD float sample_filter_1d(const float* table, float u) {
    const float x = u * float(kFilterTableSize);
    const uint32_t i = x < float(kFilterTableSize) ? uint32_t(x) : kFilterTableSize - 1;
    return lerp(table[i], table[i + 1], x - float(i));
}

/// Density per pixel of sample_filter_1d at offset `x`.
AMBILUX_HD float filter_pdf_1d(const float* table, float x) {
    if (!(x >= table[0] && x < table[kFilterTableSize])) return 0.0f;
    uint32_t lo = 0, hi = kFilterTableSize;
    while (hi - lo > 1) {
        const uint32_t mid = (lo + hi) / 2;
        if (table[mid] <= x)
            lo = mid;
        else
            hi = mid;
    }
    return 1.0f / (float(kFilterTableSize) * (table[lo + 1] - table[lo]));
}

/// Offset from the pixel's centre, in pixels, distributed as the filter.
AMBILUX_HD Vec2f sample_filter_offset(const SceneView& view, Vec2f u) {
    const float* table = view.tables + view.sensor.filter_table;
    return {sample_filter_1d(table, u.x), sample_filter_1d(table, u.y)};
}

/// Value of the normalised filter at an offset from a pixel's centre (per square pixel): the density of sample_filter_offset, hence also the weight
/// with which light that lands there counts for the pixel.
AMBILUX_HD float filter_value(const SceneView& view, Vec2f offset) {
    const float* table = view.tables + view.sensor.filter_table;
    return filter_pdf_1d(table, offset.x) * filter_pdf_1d(table, offset.y);
}

/// Film position (pixels of the full film) of a sample of pixel (x,y) of the crop.
AMBILUX_HD Vec2f sample_film_position(const SceneView& view, uint32_t pixel_x, uint32_t pixel_y, Vec2f u) {
    const Vec2f offset = sample_filter_offset(view, u);
    return {float(view.sensor.crop_x + pixel_x) + 0.5f + offset.x, float(view.sensor.crop_y + pixel_y) + 0.5f + offset.y};
}

}  // namespace ambilux
