#include "formats/gltf/textures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/error.h"

namespace ambilux::gltf {

using namespace document;

namespace {

const char* wrap_of(int mode) {
    return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? "clamp"
           : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? "mirror"
                                                           : "repeat";
}

/// Two numbers of an extension.
std::array<double, 2> pair_in(const tinygltf::Value& of, const char* key, double fallback) {
    std::array<double, 2> out{fallback, fallback};
    if (!of.Has(key) || !of.Get(key).IsArray() || of.Get(key).ArrayLen() < 2) return out;
    for (int i = 0; i < 2; ++i)
        if (of.Get(key).Get(i).IsNumber()) out[size_t(i)] = of.Get(key).Get(i).GetNumberAsDouble();
    return out;
}

}  // namespace

Used used(const tinygltf::Value* object, const char* name) {
    if (!object || !object->Has(name)) return {};
    const tinygltf::Value& info = object->Get(name);
    Used out{integer(&info, "index", -1), integer(&info, "texCoord", 0), nullptr, {}};
    if (info.Has("extensions") && info.Get("extensions").Has("KHR_texture_transform"))
        out.transform = &info.Get("extensions").Get("KHR_texture_transform");
    return out;
}

Used TextureMaker::with_image(const Used& use) {
    if (use.index < 0) return use;
    if (size_t(use.index) >= c_.model.textures.size())
        c_.fail(what_ + ": there is no texture " + std::to_string(use.index));
    const tinygltf::Texture& texture = c_.model.textures[size_t(use.index)];
    if (texture.source >= 0) return use;
    const std::string name = "texture " + std::to_string(use.index);
    if (!texture.extensions.empty())
        c_.refuse(what_ + ": the image of " + name + " is one of extension '" + texture.extensions.begin()->first +
                      "', which is not supported",
                  "it is left out");
    else
        c_.note(name + " has no image and is left out");
    return {};
}

/// Of an image that the library did not find beside the file.
std::string TextureMaker::image_path(int index) const {
    const std::string& uri = c_.model.images[size_t(index)].uri;
    try {
        return c_.document.resolve(uri.starts_with("file://") ? uri.substr(7) : uri, c_.where);
    } catch (const Error&) {
        c_.fail(fmt::format("{}: the file of image {}, '{}', does not exist", what_, index, uri));
    }
}

/// The image with this index, decoded once.
const std::string& TextureMaker::image(int index) {
    std::string& name = c_.images[index];
    if (!name.empty()) return name;
    if (index < 0 || size_t(index) >= c_.image_bytes.size())
        c_.fail(what_ + ": there is no image " + std::to_string(index));
    const std::string& uri = c_.model.images[size_t(index)].uri;
    const std::string &bytes = c_.image_bytes[size_t(index)],
                      wanted = c_.where.file + ", image " + std::to_string(index) + (uri.empty() ? "" : ", " + uri);
    const bool is_read = !bytes.empty() || uri.empty();
    const Texels& image = c_.document.images[wanted] =
        is_read ? read_image(wanted, bytes, c_.document.limits) : read_image_file(c_.document, image_path(index));
    if (is_read)
        for (const std::string& note : image.notes) c_.report.note({wanted}, note);
    return name = wanted;
}

const std::string& TextureMaker::image_of(const Used& use) {
    return use.image.empty() ? image(c_.model.textures[size_t(use.index)].source) : use.image;
}

Object& TextureMaker::bitmap(const Used& use, bool raw, const char* channel) {
    Object& out = bitmap_of(use, image_of(use));
    if (raw) set_boolean(out, "raw", true);
    if (*channel) set_text(out, "channel", channel);
    return out;
}

Object& TextureMaker::bitmap_of(const Used& use, std::string name) {
    const tinygltf::Texture& texture = c_.model.textures[size_t(use.index)];
    Matrix to_uv;
    int tex_coord = use.tex_coord;
    if (const tinygltf::Value* t = use.transform) {
        const auto [x, y] = pair_in(*t, "scale", 1);
        const auto [right, down] = pair_in(*t, "offset", 0);
        const double a = number(t, "rotation", 0);
        to_uv.m[0][0] = std::cos(a) * x, to_uv.m[0][1] = std::sin(a) * y, to_uv.m[0][3] = right;
        to_uv.m[1][0] = -std::sin(a) * x, to_uv.m[1][1] = std::cos(a) * y, to_uv.m[1][3] = down;
        tex_coord = integer(t, "texCoord", tex_coord);
    }
    if (tex_coord_ >= 0 && tex_coord != tex_coord_ && !same_coordinates(tex_coord, tex_coord_))
        c_.refuse(what_ + " uses several sets of texture coordinates", "the first of them is used");
    else if (tex_coord_ < 0)
        tex_coord_ = tex_coord;
    std::string wrap_u = "repeat", wrap_v = "repeat";
    bool nearest = false;
    if (texture.sampler >= 0 && size_t(texture.sampler) < c_.model.samplers.size()) {
        const tinygltf::Sampler& sampler = c_.model.samplers[size_t(texture.sampler)];
        wrap_u = wrap_of(sampler.wrapS), wrap_v = wrap_of(sampler.wrapT);
        nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
    }
    // There is one mode for both axes. An axis within [0, 1] takes the other one's; a mirrored image that repeats is
    // one that is mirrored.
    if (wrap_u != wrap_v && !use.transform && lies_in_unit(tex_coord, 0)) wrap_u = wrap_v;
    if (wrap_u != wrap_v && !use.transform && lies_in_unit(tex_coord, 1)) wrap_v = wrap_u;
    for (std::string* wrap : {&wrap_u, &wrap_v})
        if (wrap_u != wrap_v && *wrap == "mirror") {
            const int axis = wrap == &wrap_v;
            name = mirrored(name, axis);
            to_uv = (axis ? scaling(1, 0.5, 1) : scaling(0.5, 1, 1)) * to_uv;
            *wrap = "repeat";
        }
    Object& out = object("texture", "bitmap");
    set_text(out, "image", name);
    set_transform(out, "to_uv", to_uv);
    set_text(out, "wrap_mode_u", wrap_u);
    set_text(out, "wrap_mode_v", wrap_v);
    if (nearest) set_text(out, "filter_type", "nearest");
    return out;
}

/// True if all meshes of the material have their coordinates in [0, 1] along an axis.
bool TextureMaker::lies_in_unit(int set, int axis) const {
    const std::string name = "TEXCOORD_" + std::to_string(set);
    for (const tinygltf::Mesh& mesh : c_.model.meshes)
        for (const tinygltf::Primitive& primitive : mesh.primitives) {
            const auto it = primitive.attributes.find(name);
            if (primitive.material != material_ || it == primitive.attributes.end()) continue;
            const std::vector<double> uv = accessor_values(c_, it->second, 2, what_ + ", " + name);
            for (size_t i = size_t(axis); i < uv.size(); i += 2)
                if (!(uv[i] >= 0 && uv[i] <= 1)) return false;
        }
    return true;
}

/// True if two sets hold the same values in all meshes of the material, as exporters write them.
bool TextureMaker::same_coordinates(int a, int b) const {
    for (const tinygltf::Mesh& mesh : c_.model.meshes)
        for (const tinygltf::Primitive& primitive : mesh.primitives) {
            if (primitive.material != material_) continue;
            const auto values = [&](int set) {
                const auto it = primitive.attributes.find("TEXCOORD_" + std::to_string(set));
                return it == primitive.attributes.end() ? std::vector<double>{}
                                                        : accessor_values(c_, it->second, 2, what_ + ", " + it->first);
            };
            if (values(a) != values(b)) return false;
        }
    return true;
}

/// The image of this name, without texels if it is new.
Texels& TextureMaker::derived(const std::string& name, const Texels& source, uint32_t width, uint32_t height,
                              bool is_8bit) {
    Texels& out = c_.document.images[name];
    if (out.width) return out;
    take_texels(c_.document, c_.where, uint64_t(width) * height, is_8bit ? 4 : 16);
    out.width = width, out.height = height, out.is_8bit = is_8bit;
    out.is_linear = source.is_linear;
    return out;
}

/// The image and behind it, along the axis, its mirror image.
std::string TextureMaker::mirrored(const std::string& name, int axis) {
    const std::string out_name = name + (axis ? ", mirrored below" : ", mirrored on the right");
    const Texels& source = c_.document.images.at(name);
    Texels& out =
        derived(out_name, source, source.width * (axis ? 1 : 2), source.height * (axis ? 2 : 1), source.is_8bit);
    if (!out.bytes.empty() || !out.floats.empty()) return out_name;
    for (uint32_t y = 0; y < out.height; ++y)
        for (uint32_t x = 0; x < out.width; ++x) {
            const uint32_t from_x = x < source.width ? x : out.width - 1 - x,
                           from_y = y < source.height ? y : out.height - 1 - y;
            const auto copy = [&, i = 4 * (size_t(from_y) * source.width + from_x)](const auto& from, auto& to) {
                to.insert(to.end(), from.begin() + std::ptrdiff_t(i), from.begin() + std::ptrdiff_t(i + 4));
            };
            source.is_8bit ? copy(source.bytes, out.bytes) : copy(source.floats, out.floats);
        }
    return out_name;
}

/// Normals of the image, their slopes `scale` times as steep, and turned.
std::string TextureMaker::turned_normals(const std::string& name, double scale, const Matrix& turn) {
    const std::string out_name = fmt::format("{}, normals scaled by {}, turned by {} {} {} {}", name, scale,
                                             turn.m[0][0], turn.m[0][1], turn.m[1][0], turn.m[1][1]);
    const Texels& source = c_.document.images.at(name);
    Texels& out = derived(out_name, source, source.width, source.height, false);
    if (!out.floats.empty()) return out_name;
    for (size_t i = 0; i < 4 * size_t(out.width) * out.height; i += 4) {
        const auto value = [&](size_t k) { return 2 * source.stored(i + k) - 1; };
        const double x = value(0) * scale, y = value(1) * scale, z = value(2);
        const double n[3] = {turn.m[0][0] * x + turn.m[0][1] * y, turn.m[1][0] * x + turn.m[1][1] * y, z};
        const double l = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (const double v : n) out.floats.push_back(float(l > 0 ? 0.5 + v / l / 2 : 0.5));
        out.floats.push_back(1);
    }
    return out_name;
}

Object& TextureMaker::normals(const Used& use, double scale, bool mirrored, bool turned) {
    // The frame of a texel has its first axis along u and the second one across the normal and that. In the texture's
    // own frame, which KHR_texture_transform turns and mirrors, green is up: against v, which runs downwards.
    double a = 0, up = 1;
    if (use.transform && turned) {
        const auto [x, y] = pair_in(*use.transform, "scale", 1);
        const double angle = number(use.transform, "rotation", 0);
        up = x * y < 0 ? -1 : 1;
        if (x != 0 && y != 0) a = std::atan2(std::sin(angle) / y, std::cos(angle) / x);
    }
    Matrix turn;
    turn.m[0][0] = std::cos(a), turn.m[0][1] = std::sin(a) * up;
    turn.m[1][0] = -std::sin(a), turn.m[1][1] = std::cos(a) * up;
    if (mirrored)
        for (double& v : turn.m[1]) v = -v;
    const bool plain = scale == 1 && a == 0 && turn.m[1][1] == 1;
    Object& out = bitmap_of(use, plain ? image_of(use) : turned_normals(image_of(use), scale, turn));
    set_boolean(out, "raw", true);
    return out;
}

Object& TextureMaker::cut_alpha(const Used& use, double factor, double cutoff) {
    const std::string& name = image_of(use);
    const std::string out_name = fmt::format("{}, cut at {} of {}", name, cutoff, factor);
    const Texels& source = c_.document.images.at(name);
    Texels& out = derived(out_name, source, source.width, source.height, true);
    if (out.bytes.empty())
        for (size_t i = 0; i < size_t(out.width) * out.height; ++i) {
            const uint8_t v = source.stored(4 * i + 3) * factor >= cutoff ? 255 : 0;
            out.bytes.insert(out.bytes.end(), {v, v, v, 255});
        }
    Object& made = bitmap_of(use, out_name);
    set_boolean(made, "raw", true);
    return made;
}

const Object& TextureMaker::scaled(const Object& texture, Rgb factor) {
    if (factor == splat(1)) return texture;
    Object& out = object("texture", "scale");
    set_rgb(out, "scale", factor);
    add_child(out, texture);
    return out;
}

Rgb TextureMaker::mean(const Used& use, bool raw) {
    const Texels& source = c_.document.images[image_of(use)];
    const size_t count = size_t(source.width) * source.height;
    double sum[3] = {0, 0, 0};
    for (size_t i = 0; i < count; ++i)
        for (size_t k = 0; k < 3; ++k) sum[k] += decoded(source.stored(4 * i + k), raw || source.is_linear ? 1 : -1);
    return Rgb{float(sum[0]), float(sum[1]), float(sum[2])} / float(std::max<size_t>(count, 1));
}

}  // namespace ambilux::gltf
