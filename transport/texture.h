// Texture lookup (conventions: scene/view.h, Texture) and parameters that may come from a texture.
#pragma once

#include "core/half.h"
#include "scene/view.h"

namespace ambilux {

/// Texture coordinates (s,t) of surface coordinates (u,v).
AMBILUX_HD Vec2f texture_coordinates(const Texture& texture, Vec2f uv) {
    const auto& m = texture.to_uv;
    return {m[0][0] * uv.x + m[0][1] * uv.y + m[0][2], m[1][0] * uv.x + m[1][1] * uv.y + m[1][2]};
}

/// Linear colour of the texel in column x of row y; both must be inside.
AMBILUX_HD Rgb load_texel(const SceneView& view, const Texture& texture, uint32_t x, uint32_t y) {
    const uint64_t index = uint64_t(y) * texture.width + x;
    // One aligned copy per texel, so that a device reads it in a single vector load.
    if (texture.format == TexelFormat::rgba32f) {
        struct {
            float32 x, y, z, w;
        } texel;
        memcpy(&texel, __builtin_assume_aligned(view.texels + texture.offset + index * 16, 16), 16);
        return {texel.x, texel.y, texel.z};
    }
    if (texture.format == TexelFormat::rgba16f) {
        const auto texel = load_half4(view.texels + texture.offset + index * 8);
        return {texel.x, texel.y, texel.z};
    }
    uint32_t texel;
    memcpy(&texel, __builtin_assume_aligned(view.texels + texture.offset + index * 4, 4), 4);
    const float32* decode = view.tables + texture.decode_table;
    return {decode[texel & 255u], decode[texel >> 8 & 255u], decode[texel >> 16 & 255u]};
}

/// Reduces a coordinate to one period of the wrap mode, [0,1] or (mirror) [0,2]; what is not finite becomes 0, so that
/// texel indices stay in range whatever a mesh file says.
AMBILUX_HD float reduce_coordinate(float s, WrapMode wrap) {
    if (wrap == WrapMode::repeat) return clamp(s - floorf(s), 0.0f, 1.0f);
    if (wrap == WrapMode::mirror) return clamp(s - 2.0f * floorf(0.5f * s), 0.0f, 2.0f);
    return clamp(s, 0.0f, 1.0f);
}

/// Texel index of a reduced one, which lies at most one texel outside of the period.
AMBILUX_HD uint32_t wrap_texel(int32_t i, int32_t n, WrapMode wrap) {
    if (wrap == WrapMode::clamp) return uint32_t(i < 0 ? 0 : (i >= n ? n - 1 : i));
    const int32_t period = wrap == WrapMode::mirror ? 2 * n : n;
    if (i < 0) i += period;
    if (i >= period) i -= period;
    return uint32_t(i < n ? i : period - 1 - i);
}

/// The four texels around a point, f[row][column], and the weights of the second column and row. Texel centres lie at
/// (i+0.5)/n, as in Mitsuba's bitmap texture.
struct BilinearTexels {
    Rgb f[2][2];
    float wx, wy;
};

AMBILUX_HD BilinearTexels load_bilinear(const SceneView& view, const Texture& texture, Vec2f st) {
    const int32_t w = int32_t(texture.width), h = int32_t(texture.height);
    const float x = reduce_coordinate(st.x, texture.wrap) * float(w) - 0.5f;
    const float y = reduce_coordinate(st.y, texture.wrap) * float(h) - 0.5f;
    const float fx = floorf(x), fy = floorf(y);
    const uint32_t x0 = wrap_texel(int32_t(fx), w, texture.wrap), x1 = wrap_texel(int32_t(fx) + 1, w, texture.wrap);
    const uint32_t y0 = wrap_texel(int32_t(fy), h, texture.wrap), y1 = wrap_texel(int32_t(fy) + 1, h, texture.wrap);
    return {{{load_texel(view, texture, x0, y0), load_texel(view, texture, x1, y0)},
             {load_texel(view, texture, x0, y1), load_texel(view, texture, x1, y1)}},
            x - fx,
            y - fy};
}

/// Linear colour of a texture at surface coordinates `uv`; finite for any uv if the texels are.
template <Features F>
AMBILUX_HD_APART Rgb eval_texture(const SceneView& view, const Texture& texture, Vec2f uv) {
    const Vec2f st = texture_coordinates(texture, uv);
    if (texture.type == TextureType::checkerboard) {
        const bool right = st.x - floorf(st.x) > 0.5f, upper = st.y - floorf(st.y) > 0.5f;
        return right == upper ? texture.color0 : texture.color1;
    }
    if (texture.filter == TextureFilter::nearest) {
        const int32_t w = int32_t(texture.width), h = int32_t(texture.height);
        const int32_t x = int32_t(reduce_coordinate(st.x, texture.wrap) * float(w));
        const int32_t y = int32_t(reduce_coordinate(st.y, texture.wrap) * float(h));
        return load_texel(view, texture, wrap_texel(x, w, texture.wrap), wrap_texel(y, h, texture.wrap));
    }
    const BilinearTexels b = load_bilinear(view, texture, st);
    const Rgb row0 = b.f[0][0] * (1.0f - b.wx) + b.f[0][1] * b.wx;
    const Rgb row1 = b.f[1][0] * (1.0f - b.wx) + b.f[1][1] * b.wx;
    return row0 * (1.0f - b.wy) + row1 * b.wy;
}

/// Value of a colour parameter at surface coordinates `uv`.
template <Features F>
AMBILUX_HD Rgb eval_rgb(const SceneView& view, const ParamRgb& parameter, Vec2f uv) {
    if constexpr (F.textures)
        if (parameter.texture >= 0)
            return parameter.value * eval_texture<F>(view, view.textures[parameter.texture], uv);
    return parameter.value;
}

/// Value of a scalar parameter at surface coordinates `uv`. A colour image counts by its luminance, as in Mitsuba's
/// eval_1; a grey one has that in every channel.
template <Features F>
AMBILUX_HD float eval_float(const SceneView& view, const ParamFloat& parameter, Vec2f uv) {
    if constexpr (F.textures)
        if (parameter.texture >= 0)
            return parameter.value * luminance(eval_texture<F>(view, view.textures[parameter.texture], uv));
    return parameter.value;
}

/// Derivatives by u and v of the scalar value of a texture (a height, for bump maps): the exact gradient of the
/// bilinear interpolant, to_uv included. Zero for checkerboards and nearest-texel lookup, as in Mitsuba's eval_1_grad.
template <Features F>
AMBILUX_HD Vec2f texture_height_gradient(const SceneView& view, const Texture& texture, Vec2f uv) {
    if (texture.type != TextureType::bitmap || texture.filter == TextureFilter::nearest) return {0.0f, 0.0f};
    const BilinearTexels b = load_bilinear(view, texture, texture_coordinates(texture, uv));
    const float f00 = luminance(b.f[0][0]), f10 = luminance(b.f[0][1]);
    const float f01 = luminance(b.f[1][0]), f11 = luminance(b.f[1][1]);
    const float ds = float(texture.width) * ((1.0f - b.wy) * (f10 - f00) + b.wy * (f11 - f01));
    const float dt = float(texture.height) * ((1.0f - b.wx) * (f01 - f00) + b.wx * (f11 - f10));
    const auto& m = texture.to_uv;
    return {m[0][0] * ds + m[1][0] * dt, m[0][1] * ds + m[1][1] * dt};
}

}  // namespace ambilux
