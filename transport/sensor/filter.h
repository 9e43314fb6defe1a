// Reconstruction filters by importance sampling: a sample of a pixel is drawn with the filter's density around its
// centre and counts with weight 1, so that pixels stay independent (Ernst et al. 2006, "Filter Importance Sampling").
// Filters are separable and positive.
#pragma once

#include <vector>

#include "scene/view.h"

namespace ambilux {

namespace detail {

/// The inverse cumulative table, linear between its entries.
AMBILUX_HD float sample_filter_table(const float32* table, float u) {
    const float x = u * float(kFilterTableSize);
    const uint32_t i = x < float(kFilterTableSize) ? uint32_t(x) : kFilterTableSize - 1;
    return lerp(table[i], table[i + 1], x - float(i));
}

/// Which of kFilterTableSize equal parts of the filter's width holds the offset `x`.
AMBILUX_HD uint32_t filter_part(const float32* table, float x) {
    const float part = (x - table[0]) * table[kFilterTableSize + 1];
    return part < float(kFilterTableSize - 1) ? uint32_t(part) : kFilterTableSize - 1;
}

/// Density per pixel of sample_filter_table at offset `x`. The guide says from which entry on to look for that which
/// holds x (Chen and Asmussen 1974, "On Generating Random Variates from an Empirical Distribution"): a step or two
/// instead of ten of a binary search.
AMBILUX_HD float filter_table_pdf(const float32* table, float x) {
    if (!(x >= table[0] && x < table[kFilterTableSize])) return 0.0f;
    uint32_t i = uint32_t(table[kFilterTableSize + 2 + filter_part(table, x)]);
    float from = table[i], to = table[i + 1];
    while (to <= x) {
        from = to;
        to = table[++i + 1];
    }
    return 1.0f / (float(kFilterTableSize) * (to - from));
}

}  // namespace detail

/// Completes the table whose kFilterTableSize+1 offsets are the last of `tables`: appends the parts per pixel, and for
/// each part the last entry below it, or the first of all.
void append_filter_guide(auto& tables) {
    const size_t first = tables.size() - (kFilterTableSize + 1);
    tables.push_back(float32(kFilterTableSize) / (tables.back() - tables[first]));
    uint32_t entry = 0;
    for (uint32_t part = 0; part < kFilterTableSize; ++part) {
        while (entry < kFilterTableSize && detail::filter_part(tables.data() + first, tables[first + entry + 1]) < part)
            ++entry;
        tables.push_back(float32(entry));
    }
}

/// One coordinate of sample_filter_offset. Box and tent are inverted in closed form; the Gaussian has a table.
AMBILUX_HD float sample_filter_1d(const SceneView& view, float u) {
    const float r = view.sensor.filter_radius;
    switch (view.sensor.filter) {
        case FilterType::box: return r * (2.0f * u - 1.0f);
        case FilterType::tent: return u < 0.5f ? r * (sqrtf(2.0f * u) - 1.0f) : r * (1.0f - sqrtf(2.0f * (1.0f - u)));
        default: return detail::sample_filter_table(view.tables + view.sensor.filter_table, u);
    }
}

/// op(filter), where filter(x) is one factor of filter_value: the density per pixel of sample_filter_1d at offset `x`.
template <class Op>
AMBILUX_HD void with_filter(const SceneView& view, Op op) {
    const float r = view.sensor.filter_radius, inv = 1.0f / r;
    switch (view.sensor.filter) {
        case FilterType::box: return op([=](float x) { return x >= -r && x < r ? 0.5f * inv : 0.0f; });
        case FilterType::tent: return op([=](float x) { return max(1.0f - fabsf(x) * inv, 0.0f) * inv; });
        default:
            return op([table = view.tables + view.sensor.filter_table](float x) {
                return detail::filter_table_pdf(table, x);
            });
    }
}
AMBILUX_HD float filter_value_1d(const SceneView& view, float x) {
    float value = 0.0f;
    with_filter(view, [&](auto filter) { value = filter(x); });
    return value;
}

/// Offset from the pixel's centre, in pixels, distributed as the filter.
AMBILUX_HD Vec2f sample_filter_offset(const SceneView& view, Vec2f u) {
    return {sample_filter_1d(view, u.x), sample_filter_1d(view, u.y)};
}

/// Value of the normalised filter at an offset from a pixel's centre (per square pixel): the density of
/// sample_filter_offset, hence also the weight with which light that lands there counts for the pixel.
AMBILUX_HD float filter_value(const SceneView& view, Vec2f offset) {
    return filter_value_1d(view, offset.x) * filter_value_1d(view, offset.y);
}

/// Film position (pixels of the full film) of a sample of pixel (x,y) of the crop.
AMBILUX_HD Vec2f sample_film_position(const SceneView& view, uint32_t pixel_x, uint32_t pixel_y, Vec2f u) {
    const Vec2f offset = sample_filter_offset(view, u);
    return {float(view.sensor.crop_x + pixel_x) + 0.5f + offset.x,
            float(view.sensor.crop_y + pixel_y) + 0.5f + offset.y};
}

}  // namespace ambilux
