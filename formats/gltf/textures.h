// Textures of one material.
#pragma once

#include "formats/gltf/model.h"

namespace ambilux::gltf {

/// A texture that a material names; index -1: none.
struct Used {
    int index = -1, tex_coord = 0;
    const tinygltf::Value* transform = nullptr;  ///< KHR_texture_transform
    std::string image;                           ///< one that is made, in the place of the texture's
};
template <class Info>
Used used(const Info& info) {
    return {info.index, info.texCoord, extension(info.extensions, "KHR_texture_transform"), {}};
}
/// Of an extension.
Used used(const tinygltf::Value* object, const char* name);

/// KHR_materials_pbrSpecularGlossiness.
struct SpecularGlossiness {
    Rgb diffuse = {1, 1, 1}, specular = {1, 1, 1};
    double glossiness = 1;
    Used diffuse_texture, texture;  ///< of the second alpha is the glossiness
};
/// The same as far as it goes: base colour and metallic factor.
struct BaseAndMetal {
    Rgb base;
    double metallic = 0;
};
BaseAndMetal base_and_metal(Rgb diffuse, Rgb specular);

class TextureMaker {
public:
    /// `material` and its name for messages.
    TextureMaker(Context& context, int material, std::string what)
        : c_(context), material_(material), what_(std::move(what)) {}

    /// The same, or none where the file gives the texture no image.
    Used with_image(const Used& use);
    /// Bitmap of a texture. `channel`: "r" to "a", or all.
    Object& bitmap(const Used& use, bool raw, const char* channel = "");
    /// Normals whose slopes are `scale` times as steep. `mirrored`: on faces that show them in a mirror; `turned`: they
    /// follow KHR_texture_transform.
    Object& normals(const Used& use, double scale, bool mirrored, bool turned);
    /// 1 where alpha times `factor` reaches `cutoff`, else 0.
    Object& cut_alpha(const Used& use, double factor, double cutoff);
    const Object& scaled(const Object& texture, Rgb factor);
    /// Textures of the base colour, and of roughness and metal, made of those of `from`, which has one at least.
    void convert(const SpecularGlossiness& from, Used& base, Used& rough);
    /// Of all texels, colours decoded unless `raw`.
    Rgb mean(const Used& use, bool raw);
    /// The set of coordinates that its textures use.
    int tex_coord() const { return std::max(tex_coord_, 0); }
    bool any() const { return tex_coord_ >= 0; }

private:
    Object& object(const char* tag, const char* type) { return document::add_object(c_.document, tag, type, c_.where); }
    std::string image_path(int index) const;
    const std::string& image(int index);
    /// Of a texture that is there.
    const std::string& image_of(const Used& use);
    Object& bitmap_of(const Used& use, std::string image);
    bool lies_in_unit(int set, int axis) const;
    bool same_coordinates(int a, int b) const;
    Texels& derived(const std::string& name, const Texels& source, uint32_t width, uint32_t height, bool is_8bit);
    std::string mirrored(const std::string& name, int axis);
    std::string turned_normals(const std::string& name, double scale, const Matrix& turn);

    Context& c_;
    int material_;
    std::string what_;
    int tex_coord_ = -1;
};

}  // namespace ambilux::gltf
