#include "formats/mitsuba/baked_textures.h"

#include <algorithm>
#include <cstring>
#include <numeric>

#include "transport/texture.h"

namespace ambilux::mitsuba {

namespace {

/// Texels a side of a grid for textures of different sizes.
constexpr uint32_t kMostTexels = 4096;

bool is_flat(const Texture& t) { return t.type == TextureType::checkerboard && t.color0 == t.color1; }

bool is_stepped(const Texture& t) { return t.type == TextureType::checkerboard || t.filter == TextureFilter::nearest; }

WrapMode wrap_of(const Texture& t) { return t.type == TextureType::checkerboard ? WrapMode::repeat : t.wrap; }

/// What is constant among the inputs is moved into `value`.
struct Input {
    Rgb value;
    const Texture* texture = nullptr;
};

/// Texels a side along one axis: steps fall on edges of texels, and what is interpolated gets twice as many.
uint32_t grid_size(const std::vector<Input>& inputs, uint32_t Texture::* side, bool stepped) {
    uint64_t common = 1;
    uint32_t most = 1;
    for (const Input& input : inputs) {
        if (!input.texture) continue;
        const uint32_t n = input.texture->type == TextureType::checkerboard ? 2 : input.texture->*side;
        most = std::max(most, n);
        common = std::min<uint64_t>(std::lcm(common, uint64_t(n)), 2 * uint64_t(kMostTexels));
    }
    if (stepped && common <= kMostTexels) return uint32_t(common);
    return std::max(most, std::min(2 * most, kMostTexels));
}

}  // namespace

ParamRgb baked_color(Builder& builder, const Reader& in, const std::vector<ParamRgb>& inputs, const BakedFunction& f) {
    if (builder.validate_only) return {splat(1), -1};
    std::vector<Input> parts;
    const Texture* model = nullptr;
    bool one_size = true, stepped = true;
    for (const ParamRgb& p : inputs) {
        parts.push_back({p.value});
        if (p.texture < 0) continue;
        const Texture& t = builder.scene.textures[size_t(p.texture)];
        if (is_flat(t)) {
            parts.back().value = p.value * t.color0;
            continue;
        }
        parts.back().texture = &t;
        if (!model) model = &t;
        if (memcmp(t.to_uv, model->to_uv, sizeof t.to_uv) != 0 || wrap_of(t) != wrap_of(*model))
            in.fail("textures that are combined must have the same coordinates and wrap mode");
        stepped &= is_stepped(t);
        one_size &= t.type == TextureType::bitmap && is_stepped(t) == is_stepped(*model) && t.width == model->width &&
                    t.height == model->height;
    }
    std::vector<Rgb> values(parts.size());
    if (!model) {
        for (size_t i = 0; i < parts.size(); ++i) values[i] = parts[i].value;
        return {f(values), -1};
    }
    Texture out = *model;
    out.type = TextureType::bitmap;
    out.wrap = wrap_of(*model);
    out.filter = stepped ? TextureFilter::nearest : TextureFilter::bilinear;
    out.color0 = out.color1 = {0, 0, 0};
    out.decode_table = 0;
    if (!one_size) {
        out.width = grid_size(parts, &Texture::width, stepped);
        out.height = grid_size(parts, &Texture::height, stepped);
    }
    const size_t count = size_t(out.width) * out.height;
    builder.take_memory(count * 16, in.where().file);
    // Lookups are in the textures' own coordinates.
    std::vector<Texture> own;
    for (const Input& part : parts) {
        own.push_back(part.texture ? *part.texture : out);
        own.back().to_uv[0][0] = own.back().to_uv[1][1] = 1;
        own.back().to_uv[0][1] = own.back().to_uv[0][2] = own.back().to_uv[1][0] = own.back().to_uv[1][2] = 0;
    }
    const SceneView view = builder.scene.view();
    std::vector<float> texels;
    texels.reserve(4 * count);
    double sum[3] = {0, 0, 0};
    for (uint32_t y = 0; y < out.height; ++y)
        for (uint32_t x = 0; x < out.width; ++x) {
            const Vec2f st = {(float(x) + 0.5f) / float(out.width), (float(y) + 0.5f) / float(out.height)};
            for (size_t i = 0; i < parts.size(); ++i) {
                values[i] = parts[i].value;
                if (!parts[i].texture) continue;
                values[i] *= one_size ? load_texel(view, own[i], x, y) : eval_texture<kAllFeatures>(view, own[i], st);
            }
            const Rgb c = f(values);
            for (int i = 0; i < 3; ++i) sum[i] += double(c[i]);
            texels.insert(texels.end(), {c.x, c.y, c.z, 1.0f});
        }
    const double n = double(count);
    return {splat(1),
            add_baked_texture(builder, out, texels, {float(sum[0] / n), float(sum[1] / n), float(sum[2] / n)})};
}

ParamFloat baked_number(Builder& builder, const Reader& in, const std::vector<ParamFloat>& inputs,
                        const std::function<float(const std::vector<float>&)>& f) {
    std::vector<ParamRgb> colors;
    for (const ParamFloat& p : inputs) colors.push_back({splat(p.value), p.texture});
    std::vector<float> numbers(inputs.size());
    const ParamRgb out = baked_color(builder, in, colors, [&](const std::vector<Rgb>& values) {
        // A grey as it is, without the rounding of its luminance.
        for (size_t i = 0; i < numbers.size(); ++i) {
            const Rgb c = values[i];
            numbers[i] = c.x == c.y && c.x == c.z ? c.x : luminance(c);
        }
        return splat(f(numbers));
    });
    return {out.value.x, out.texture};
}

}  // namespace ambilux::mitsuba
