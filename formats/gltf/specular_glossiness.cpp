// KHR_materials_pbrSpecularGlossiness as metallic-roughness, by the conversion that Khronos gives for it (glTF,
// archived extensions, convert-between-workflows).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/srgb.h"
#include "formats/gltf/textures.h"

namespace ambilux::gltf {

namespace {

constexpr double kDielectric = 0.04;  // reflectance at normal incidence of what is no metal

double brightness(Rgb c) { return std::sqrt(0.299 * c.x * c.x + 0.587 * c.y * c.y + 0.114 * c.z * c.z); }

/// Of an 8-bit image as it is, of others scaled.
uint8_t byte_of(double v) { return uint8_t(std::lround(std::clamp(v, 0.0, 1.0) * 255)); }

/// A texel of an image of any size at a place in [0, 1)²: colour decoded, and alpha.
struct Sample {
    Rgb color = {1, 1, 1};
    double alpha = 1;
};
Sample sample(const Texels* image, double u, double v) {
    if (!image) return {};
    const size_t x = std::min(size_t(u * image->width), size_t(image->width) - 1),
                 y = std::min(size_t(v * image->height), size_t(image->height) - 1), at = y * image->width + x;
    return {image->linear(at), image->stored(4 * at + 3)};
}

}  // namespace

BaseAndMetal base_and_metal(Rgb diffuse, Rgb specular) {
    const double rest = 1 - std::clamp(double(max_component(specular)), 0.0, 1.0), bright = brightness(specular);
    double metallic = 0;
    if (bright >= kDielectric) {
        const double b = brightness(diffuse) * rest / (1 - kDielectric) + bright - 2 * kDielectric,
                     d = b * b - 4 * kDielectric * (kDielectric - bright);
        metallic = std::clamp((std::sqrt(std::max(d, 0.0)) - b) / (2 * kDielectric), 0.0, 1.0);
    }
    BaseAndMetal out{{}, metallic};
    for (int k = 0; k < 3; ++k) {
        const double from_diffuse = diffuse[k] * rest / (1 - kDielectric) / std::max(1 - metallic, 1e-6),
                     from_specular = (specular[k] - kDielectric * (1 - metallic)) / std::max(metallic, 1e-6),
                     share = metallic * metallic;
        out.base[k] = float(std::clamp(from_diffuse * (1 - share) + from_specular * share, 0.0, 1.0));
    }
    return out;
}

void TextureMaker::convert(const SpecularGlossiness& from, Used& base, Used& rough) {
    const Used &a = from.diffuse_texture, &b = from.texture;
    if (a.index >= 0 && b.index >= 0 && (a.tex_coord != b.tex_coord || !a.transform != !b.transform))
        c_.refuse(what_ + " uses several sets of texture coordinates", "the first of them is used");
    const auto find = [&](const Used& u) { return u.index < 0 ? nullptr : &c_.document.images.at(image_of(u)); };
    const Texels *diffuse = find(a), *specular = find(b);
    base = rough = a.index >= 0 ? a : b;
    const std::string name = fmt::format("{}, {}, specular {} {} {} {}, diffuse {} {} {}", diffuse ? image_of(a) : "",
                                         specular ? image_of(b) : "", from.specular.x, from.specular.y, from.specular.z,
                                         from.glossiness, from.diffuse.x, from.diffuse.y, from.diffuse.z);
    base.image = name + ", base colour";
    rough.image = name + ", roughness";
    uint32_t width = 0, height = 0;
    for (const Texels* t : {diffuse, specular})
        if (t) width = std::max(width, t->width), height = std::max(height, t->height);
    const Texels& any = diffuse ? *diffuse : *specular;
    Texels &colors = derived(base.image, any, width, height, true),
           &numbers = derived(rough.image, any, width, height, true);
    colors.is_linear = numbers.is_linear = false;
    if (!colors.bytes.empty()) return;
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const double u = (x + 0.5) / width, v = (y + 0.5) / height;
            const Sample d = sample(diffuse, u, v), s = sample(specular, u, v);
            const BaseAndMetal as = base_and_metal(d.color * from.diffuse, s.color * from.specular);
            for (int k = 0; k < 3; ++k) colors.bytes.push_back(byte_of(linear_to_srgb(as.base[k])));
            colors.bytes.push_back(byte_of(d.alpha));
            numbers.bytes.insert(numbers.bytes.end(),
                                 {0, byte_of(1 - s.alpha * from.glossiness), byte_of(as.metallic), 255});
        }
}

}  // namespace ambilux::gltf
