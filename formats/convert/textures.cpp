#include <fmt/format.h>

#include <cmath>

#include "core/srgb.h"
#include "formats/convert/writer.h"
#include "formats/images/image_write.h"
#include "transport/texture.h"

namespace ambilux::convert {

namespace {

/// How bytes of a texture become values, as Mitsuba names it.
enum class Decoding { srgb, linear, other };

Decoding decoding_of(const Scene& scene, const Texture& t) {
    if (t.format != TexelFormat::rgba8) return Decoding::other;
    const float* table = scene.tables.data() + t.decode_table;
    bool linear = true, srgb = true;
    for (int i = 0; i < 256; ++i) {
        const double v = i / 255.0, s = srgb_to_linear(v);
        linear &= std::fabs(table[i] - v) < 1e-6;
        srgb &= std::fabs(table[i] - s) < 1e-6;
    }
    return linear ? Decoding::linear : srgb ? Decoding::srgb : Decoding::other;
}

size_t texel_count(const Texture& t) { return size_t(t.width) * t.height; }

std::vector<float> linear_texels(const Scene& scene, const Texture& t, Rgb factor) {
    std::vector<float> rgb;
    rgb.reserve(texel_count(t) * 3);
    const SceneView view = scene.view();
    for (uint32_t y = 0; y < t.height; ++y)
        for (uint32_t x = 0; x < t.width; ++x) {
            const Rgb c = load_texel(view, t, x, y) * factor;
            rgb.insert(rgb.end(), {c.x, c.y, c.z});
        }
    return rgb;
}

std::string byte_image(Writer& writer, const Texture& t) {
    std::string& name = writer.images[fmt::format("bytes {} {}x{}", t.offset, t.width, t.height)];
    if (!name.empty()) return name;
    const std::string file = fmt::format("image{:03}.png", writer.images.size());
    std::vector<uint8_t> rgb;
    const uint8_t* texels = writer.scene.texels.data() + t.offset;
    for (size_t i = 0; i < texel_count(t); ++i) rgb.insert(rgb.end(), texels + 4 * i, texels + 4 * i + 3);
    write_byte_image(writer.folder + "/" + file, t.width, t.height, rgb);
    return name = writer.prefix + "/" + file;
}

void add_to_uv(xml_node node, const Texture& t) {
    const float(&m)[2][3] = t.to_uv;
    if (m[0][0] == 1 && m[0][1] == 0 && m[0][2] == 0 && m[1][0] == 0 && m[1][1] == 1 && m[1][2] == 0) return;
    Affine a{};
    for (int i = 0; i < 2; ++i) a.m[i][0] = m[i][0], a.m[i][1] = m[i][1], a.m[i][3] = m[i][2];
    a.m[2][2] = 1;
    add_transform(node, "to_uv", a);
}

}  // namespace

std::string float_image(Writer& writer, const Texture& t, Rgb factor) {
    std::string& name = writer.images[fmt::format("floats {} {}x{} {} {} {} {} {}", t.offset, t.width, t.height,
                                                  int(t.format), t.decode_table, factor.x, factor.y, factor.z)];
    if (!name.empty()) return name;
    const std::string file = fmt::format("image{:03}.exr", writer.images.size());
    write_float_image(writer.folder + "/" + file, t.width, t.height, linear_texels(writer.scene, t, factor));
    return name = writer.prefix + "/" + file;
}

void add_texture(Writer& writer, xml_node parent, const char* name, int32_t texture, Rgb factor, bool is_number) {
    const Texture& t = writer.scene.textures[size_t(texture)];
    if (t.type == TextureType::checkerboard) {
        xml_node node = add_object(parent, "texture", "checkerboard", name);
        // Mitsuba 3 exchanges the colours of checkerboards of numbers.
        add_rgb(node, "color0", (is_number ? t.color1 : t.color0) * factor);
        add_rgb(node, "color1", (is_number ? t.color0 : t.color1) * factor);
        return add_to_uv(node, t);
    }
    xml_node node = add_object(parent, "texture", "bitmap", name);
    const Decoding decoding = decoding_of(writer.scene, t);
    const bool as_bytes = decoding != Decoding::other && factor == splat(1);
    add_text(node, "filename", as_bytes ? byte_image(writer, t) : float_image(writer, t, factor));
    add_boolean(node, "raw", !(as_bytes && decoding == Decoding::srgb));
    constexpr const char* wraps[] = {"repeat", "mirror", "clamp"};
    add_text(node, "wrap_mode", wraps[uint32_t(t.wrap)]);
    add_text(node, "filter_type", t.filter == TextureFilter::nearest ? "nearest" : "bilinear");
    add_to_uv(node, t);
}

void add_color(Writer& writer, xml_node parent, const char* name, const ParamRgb& value, bool white_is_default) {
    if (value.texture >= 0) return add_texture(writer, parent, name, value.texture, value.value, false);
    if (!white_is_default || !(value.value == splat(1))) add_rgb(parent, name, value.value);
}

void add_textured_number(Writer& writer, xml_node parent, const char* name, const ParamFloat& value) {
    if (value.texture >= 0) return add_texture(writer, parent, name, value.texture, splat(value.value), true);
    add_number(parent, name, value.value);
}

}  // namespace ambilux::convert
