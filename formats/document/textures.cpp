#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/document/builder.h"
#include "formats/document/plugins.h"
#include "formats/images/image_io.h"

namespace ambilux::document {

namespace {

/// How the values of an image are stored; 0: as its format implies.
double read_gamma(Reader& in) {
    const double gamma = in.number("gamma", 0);
    if (!(gamma >= 0 && gamma <= 100) && gamma != -1)
        in.fail(in.where("gamma"), "gamma must lie between 0 and 100, or be -1 for sRGB");
    return gamma;
}

/// uv transform: `to_uv` of the newer format, scale and offset of the older one.
void read_to_uv(Reader& in, float out[2][3]) {
    const Matrix m = in.transform("to_uv");
    if (in.text("coordinates", "uv") != "uv") in.fail(in.where("coordinates"), "textures have coordinates uv only");
    const double both = in.number("uvscale", 1), su = in.number("uscale", both), sv = in.number("vscale", both),
                 ou = in.number("uoffset", 0), ov = in.number("voffset", 0);
    const int columns[3] = {0, 1, 3};
    for (int j = 0; j < 3; ++j) {
        out[0][j] = float(su * m.m[0][columns[j]] + (j == 2 ? ou : 0));
        out[1][j] = float(sv * m.m[1][columns[j]] + (j == 2 ? ov : 0));
        if (!std::isfinite(out[0][j]) || !std::isfinite(out[1][j]))
            in.fail("the transform of the texture is not finite");
    }
}

WrapMode wrap_mode(Builder& builder, Reader& in) {
    std::string mode = in.text("wrap_mode", "repeat");
    const std::string u = in.text("wrap_mode_u", mode), v = in.text("wrap_mode_v", mode);
    if (u != v)
        builder.refuse(in.where("wrap_mode_v"), "different wrap modes for u and v are not supported",
                       "that of u is used for both");
    mode = u;
    if (mode == "repeat") return WrapMode::repeat;
    if (mode == "mirror") return WrapMode::mirror;
    if (mode == "clamp") return WrapMode::clamp;
    builder.refuse(in.where(in.has("wrap_mode") ? "wrap_mode" : "wrap_mode_u"), "unknown wrap mode '" + mode + "'",
                   "repeat is used");
    return WrapMode::repeat;
}

TextureFilter texture_filter(Builder& builder, Reader& in) {
    const std::string filter = in.text("filter_type", "bilinear");
    if (filter == "nearest") return TextureFilter::nearest;
    // The older generation's prefiltered lookups have no counterpart for paths without differentials.
    if (filter != "bilinear" && filter != "trilinear" && filter != "ewa")
        builder.refuse(in.where("filter_type"), "unknown filter type '" + filter + "'", "bilinear is used");
    return TextureFilter::bilinear;
}

int32_t add_texture(Builder& builder, const Texture& texture, const TextureFacts& facts) {
    const std::string key(reinterpret_cast<const char*>(&texture), sizeof texture);
    const auto [it, added] = builder.texture_pool.try_emplace(key, int32_t(builder.scene.textures.size()));
    if (added) {
        builder.scene.textures.push_back(texture);
        builder.texture_facts.push_back(facts);
    }
    return it->second;
}

bool is_color(TextureUse use) { return use == TextureUse::color || use == TextureUse::light; }

/// Value of a rawconstant: a number or three of them, which need be no colour.
Rgb raw_value(Reader& in, bool colors) {
    const Value* value = in.object().find("value");
    if (!value) in.fail_without("value", "rawconstant has no value");
    if (value->kind != ValueKind::vector) return in.color("value", {}, SpectrumUse::unbounded);
    const Vec3d v = in.vector("value", {});
    if (colors && std::min({v.x, v.y, v.z}) < 0) in.fail(in.where("value"), "'value' is negative");
    return {float(v.x), float(v.y), float(v.z)};
}

/// What colours of textures may be: those of lights, numbers and maps have no largest one.
SpectrumUse colors_of(TextureUse use) {
    if (!is_color(use)) return SpectrumUse::unbounded;
    return use == TextureUse::light ? SpectrumUse::emission : SpectrumUse::reflectance;
}

/// Grid of lines on a ground: a bitmap of one period, as fine as the lines need.
void read_grid(Builder& builder, Reader& in, TextureUse use, Texture& texture, TextureFacts& facts) {
    constexpr uint32_t kMost = 1024;
    const Rgb ground = in.color("color0", splat(0.2f), colors_of(use)),
              line = in.color("color1", splat(0.4f), colors_of(use));
    const double width = in.number("line_width", 0.01);
    if (!(width > 0 && width < 0.5)) in.fail(in.where("line_width"), "line_width must lie between 0 and 0.5");
    read_to_uv(in, texture.to_uv);
    if (builder.validate_only) return;
    // The first number of texels of which whole ones are as wide as a line, or the best one.
    uint32_t n = 2;
    for (uint32_t k = 2; k <= kMost; ++k) {
        const auto error = [&](uint32_t m) { return std::fabs(width - std::max(std::round(width * m), 1.0) / m); };
        if (error(k) < 0.999 * error(n) && error(n) > 1e-9) n = k;
    }
    const uint32_t lines = uint32_t(std::max(std::round(width * n), 1.0));
    std::vector<float> texels;
    const auto is_line = [&](uint32_t i) { return i < lines || i >= n - lines; };
    for (uint32_t y = 0; y < n; ++y)
        for (uint32_t x = 0; x < n; ++x) {
            const Rgb c = is_line(x) || is_line(y) ? line : ground;
            facts.mean += c * (1.0f / (float(n) * float(n)));
            texels.insert(texels.end(), {c.x, c.y, c.z, 1.0f});
        }
    builder.take_memory(texels.size() * sizeof(float), in.where().file);
    texture.type = TextureType::bitmap;
    texture.format = TexelFormat::rgba32f;
    texture.wrap = WrapMode::repeat;
    texture.filter = TextureFilter::nearest;
    texture.width = texture.height = n;
    texture.offset = append_texels(builder.scene, texels.data(), texels.size() * sizeof(float));
}

/// The texels of a bitmap.
void set_image(Texture& texture, const LoadedImage& image) {
    texture.type = TextureType::bitmap;
    texture.format = image.format;
    texture.width = image.width;
    texture.height = image.height;
    texture.offset = image.offset;
    texture.decode_table = image.decode_table;
}

/// An image of a file or of the document.
void read_bitmap(Builder& builder, Reader& in, TextureUse use, Texture& texture, TextureFacts& facts) {
    const Texels* given = given_image(builder, in);
    const std::string name = in.text(given ? "image" : "filename", "");
    if (name.empty()) in.fail_without("filename", "bitmap texture has no filename");
    const std::string path = given ? name : builder.file(name, in.where("filename"));
    const bool raw = in.boolean("raw", false);
    const double given_gamma = read_gamma(in), gamma = raw ? 1 : given_gamma;
    const std::string channel = in.text("channel", "");
    if (channel.size() > 1 || std::string("rgba").find(channel) == std::string::npos)
        in.fail(in.where("channel"), "'" + channel + "' is no channel: r, g, b or a");
    texture.wrap = wrap_mode(builder, in);
    texture.filter = texture_filter(builder, in);
    read_to_uv(in, texture.to_uv);
    in.leave({{"format", "auto|variant"}, {"accel"}, {"max_anisotropy"}, {"cache"}},
             "textures are stored in our own way");
    in.finish();
    if (builder.validate_only) return;
    const LoadedImage image = load_image(builder, path, gamma, false, is_color(use),
                                         channel.empty() ? -1 : int(std::string("rgba").find(channel)), given);
    set_image(texture, image);
    facts = image.facts;
}

void read_checkerboard(Builder& builder, Reader& in, TextureUse use, Texture& texture, TextureFacts& facts) {
    texture.type = TextureType::checkerboard;
    texture.color0 = in.color("color0", splat(0.4f), colors_of(use));
    texture.color1 = in.color("color1", splat(0.2f), colors_of(use));
    read_to_uv(in, texture.to_uv);
    in.finish();
    if (!builder.validate_only && use == TextureUse::number && in.object().version >= 3) {
        std::swap(texture.color0, texture.color1);
        builder.note(in.where(), "a checkerboard of numbers has its colours exchanged, as in Mitsuba 3");
    }
    facts.mean = (texture.color0 + texture.color1) * 0.5f;
    facts.largest = max(texture.color0, texture.color1);
}

}  // namespace

const Texels* given_image(const Builder& builder, Reader& in) {
    const Document& document = builder.document;
    const bool none = document.images.empty() && document.given_images.empty() && !document.first;
    if (none || !in.has("image")) return nullptr;
    const Texels* image = document.image(in.text("image", ""));
    if (!image) in.fail("the document has no image of that name");
    return image;
}

ScaledTexture load_scaled_texture(Builder& builder, const Object& object, TextureUse use) {
    Rgb scale = splat(1);
    const Object* inner = &object;
    while (inner->type == "scale") {
        Reader in(builder, *inner);
        scale = scale * in.color("scale", splat(1), SpectrumUse::unbounded);
        const Object* nested = in.take("texture");
        if (!nested) in.fail("a texture of type 'scale' has no nested texture");
        in.finish();
        inner = nested;
    }
    if (is_attribute(*inner)) scale *= float(Reader(builder, *inner).number("scale", 1));
    return {load_texture(builder, *inner, use), scale};
}

int32_t load_texture(Builder& builder, const Object& object, TextureUse use) {
    Reader in(builder, object);
    if (is_attribute(object)) return attribute_texture(builder, in);
    Texture texture;
    memset(&texture, 0, sizeof texture);  // padding too, because the record is its own key
    TextureFacts facts{{}, {}, object.where.file};
    if (object.type == "bitmap") {
        read_bitmap(builder, in, use, texture, facts);
    } else if (object.type == "checkerboard") {
        read_checkerboard(builder, in, use, texture, facts);
    } else if (object.type == "rawconstant") {
        texture.type = TextureType::checkerboard;
        texture.color0 = texture.color1 = facts.mean = facts.largest = raw_value(in, is_color(use));
        in.finish();
    } else if (object.type == "gridtexture") {
        read_grid(builder, in, use, texture, facts);
        in.finish();
    } else {
        builder.refuse(object.where,
                       "texture type '" + object.type + "' is not supported" + what_is_meant("texture", object.type),
                       "a grey of 0.5 is used");
        texture.type = TextureType::checkerboard;
        texture.color0 = texture.color1 = facts.mean = splat(0.5f);
    }
    return builder.validate_only ? 0 : add_texture(builder, texture, facts);
}

namespace {

int32_t add_plain_texture(Builder& builder, const LoadedImage& image) {
    Texture texture;
    memset(&texture, 0, sizeof texture);
    set_image(texture, image);
    texture.wrap = WrapMode::repeat;
    texture.filter = TextureFilter::bilinear;
    texture.to_uv[0][0] = texture.to_uv[1][1] = 1;
    return add_texture(builder, texture, image.facts);
}

int32_t add_texels(Builder& builder, uint32_t width, uint32_t height, const std::vector<float>& texels, bool allow_half,
                   const TextureFacts& facts) {
    LoadedImage image;
    image.width = width;
    image.height = height;
    image.facts = facts;
    image.offset = append_floats(builder.scene, texels, allow_half, image.format);
    return add_plain_texture(builder, image);
}

}  // namespace

int32_t load_environment_image(Builder& builder, Reader& in, const std::string& path, float& largest,
                               const Texels* given) {
    const double gamma = given ? 1 : in.object().version < 2 ? read_gamma(in) : 0;
    const LoadedImage image = load_image(builder, path, gamma, true, true, -1, given);
    largest = max_component(image.facts.largest);
    return add_plain_texture(builder, image);
}

int32_t add_atlas(Builder& builder, uint32_t width, uint32_t height, const std::vector<float>& texels,
                  const TextureFacts& facts) {
    return add_texels(builder, width, height, texels, false, facts);
}

int32_t add_baked_texture(Builder& builder, const Texture& settings, const std::vector<float>& texels,
                          const TextureFacts& facts) {
    Texture texture = settings;
    texture.offset = append_floats(builder.scene, texels, false, texture.format);
    return add_texture(builder, texture, facts);
}

int32_t add_environment_image(Builder& builder, uint32_t width, uint32_t height, const std::vector<float>& texels) {
    return add_texels(builder, width, height, texels, true, {});
}

Rgb mean_color(const Builder& builder, const ParamRgb& parameter) {
    return parameter.texture >= 0 && !builder.validate_only
               ? parameter.value * builder.texture_facts[size_t(parameter.texture)].mean
               : parameter.value;
}

const Plugins& texture_plugins() {
    static const Plugins known = {"bitmap",         "checkerboard", "gridtexture", "rawconstant",
                                  "mesh_attribute", "vertexcolors", "scale"};
    return known;
}

}  // namespace ambilux::document
