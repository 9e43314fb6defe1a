#include "formats/document/baked_textures.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "transport/texture.h"

namespace ambilux::document {

namespace {

/// Texels a side of what is made: where edges of texels must be kept, and where a finer grid is but more exact.
constexpr uint64_t kMostTexels = 4096, kMostFine = 2048;

bool is_flat(const Texture& t) { return t.type == TextureType::checkerboard && t.color0 == t.color1; }

bool is_stepped(const Texture& t) { return t.type == TextureType::checkerboard || t.filter == TextureFilter::nearest; }

WrapMode wrap_of(const Texture& t) { return t.type == TextureType::checkerboard ? WrapMode::repeat : t.wrap; }

/// What is constant among the inputs is moved into `value`.
struct Input {
    Rgb value;
    const Texture* texture = nullptr;
    uint32_t periods[2] = {1, 1};  ///< of the texture, in one of the bitmap
};

double density(const Texture& t) {
    return std::fabs(double(t.to_uv[0][0]) * t.to_uv[1][1] - double(t.to_uv[0][1]) * t.to_uv[1][0]);
}

/// Surface coordinates of texture coordinates.
Vec2f surface_coordinates(const Texture& t, double s, double v) {
    const auto& m = t.to_uv;
    const double det = double(m[0][0]) * m[1][1] - double(m[0][1]) * m[1][0], a = s - m[0][2], b = v - m[1][2];
    return {float((m[1][1] * a - m[0][1] * b) / det), float((m[0][0] * b - m[1][0] * a) / det)};
}

/// False unless the texture repeats along each axis of the model a whole number of times, or is laid out as the model.
bool count_periods(Input& input, const Texture& model) {
    const Texture& t = *input.texture;
    if (wrap_of(t) != wrap_of(model)) return false;
    if (memcmp(t.to_uv, model.to_uv, sizeof t.to_uv) == 0) return true;
    if (wrap_of(t) != WrapMode::repeat || !(density(model) > 0)) return false;
    const auto place = [&](double s, double v) { return texture_coordinates(t, surface_coordinates(model, s, v)); };
    const Vec2f o = place(0, 0), x = place(1, 0) - o, y = place(0, 1) - o;
    const auto whole = [](float f) {
        return std::fabs(f - std::round(f)) < 1e-4f && std::fabs(f) > 0.5f && std::fabs(f) <= float(kMostTexels);
    };
    if (!whole(x.x) || !whole(y.y) || !(std::fabs(x.y) < 1e-4f) || !(std::fabs(y.x) < 1e-4f)) return false;
    input.periods[0] = uint32_t(std::lround(std::fabs(x.x))), input.periods[1] = uint32_t(std::lround(std::fabs(y.y)));
    return true;
}

/// Texels a side along an axis. Edges of steps fall on edges of texels; centres of interpolated texels on centres.
uint32_t grid_size(const std::vector<Input>& inputs, int axis, bool stepped) {
    uint64_t common = 1, most = 1;
    for (const Input& input : inputs) {
        if (!input.texture) continue;
        const Texture& t = *input.texture;
        const uint64_t n = uint64_t(t.type == TextureType::checkerboard ? 2
                                    : axis                              ? t.height
                                                                        : t.width) *
                           input.periods[axis];
        most = std::max(most, n);
        common = std::min(std::lcm(common, n), 2 * kMostTexels);
    }
    if (stepped && common <= kMostTexels) return uint32_t(common);
    for (const uint64_t fine : {5, 3})
        if (fine * most <= kMostFine) return uint32_t(fine * most);
    return uint32_t(most);
}

}  // namespace

ParamRgb baked_color(Builder& builder, const Reader& in, const std::vector<ParamRgb>& inputs, const BakedFunction& f) {
    if (builder.validate_only) return {splat(1), -1};
    std::vector<Input> parts;
    const Texture* model = nullptr;  // the one with the longest period
    bool stepped = true;
    for (const ParamRgb& p : inputs) {
        parts.push_back({p.value});
        if (p.texture < 0) continue;
        const Texture& t = builder.scene.textures[size_t(p.texture)];
        if (is_flat(t)) {
            parts.back().value = p.value * t.color0;
            continue;
        }
        parts.back().texture = &t;
        if (!model || density(t) < density(*model)) model = &t;
        stepped &= is_stepped(t);
    }
    std::vector<Rgb> values(parts.size());
    if (!model) {
        for (size_t i = 0; i < parts.size(); ++i) values[i] = parts[i].value;
        return {f(values), -1};
    }
    for (Input& part : parts)
        if (part.texture && !count_periods(part, *model))
            in.fail(
                "textures that are combined must have the same wrap mode, and coordinates that fit into each other");
    Texture out = *model;
    out.type = TextureType::bitmap;
    out.wrap = wrap_of(*model);
    out.filter = stepped ? TextureFilter::nearest : TextureFilter::bilinear;
    out.color0 = out.color1 = {0, 0, 0};
    out.decode_table = 0;
    out.width = grid_size(parts, 0, stepped);
    out.height = grid_size(parts, 1, stepped);
    const size_t count = size_t(out.width) * out.height;
    builder.take_memory(count * 16, in.where().file);
    const SceneView view = builder.scene.view();
    std::vector<float> texels;
    texels.reserve(4 * count);
    TextureFacts facts{{}, {}, in.where().file};
    double sum[3] = {0, 0, 0};
    for (uint32_t y = 0; y < out.height; ++y)
        for (uint32_t x = 0; x < out.width; ++x) {
            const Vec2f uv = surface_coordinates(*model, (x + 0.5) / out.width, (y + 0.5) / out.height);
            for (size_t i = 0; i < parts.size(); ++i) {
                values[i] = parts[i].value;
                if (parts[i].texture) values[i] *= eval_texture<kAllFeatures>(view, *parts[i].texture, uv);
            }
            const Rgb c = f(values);
            for (int i = 0; i < 3; ++i) sum[i] += double(c[i]);
            facts.largest = max(facts.largest, c);
            texels.insert(texels.end(), {c.x, c.y, c.z, 1.0f});
        }
    for (int i = 0; i < 3; ++i) facts.mean[i] = float(sum[i] / double(count));
    return {splat(1), add_baked_texture(builder, out, texels, facts)};
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

}  // namespace ambilux::document
