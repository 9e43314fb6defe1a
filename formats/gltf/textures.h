// Textures of one material.
#pragma once

#include "formats/gltf/model.h"

namespace ambilux::gltf {

/// A texture that a material names; index -1: none.
struct Used {
    int index = -1, tex_coord = 0;
    const tinygltf::Value* transform = nullptr;  ///< KHR_texture_transform
};
template <class Info>
Used used(const Info& info) {
    return {info.index, info.texCoord, extension(info.extensions, "KHR_texture_transform")};
}
/// Of an extension.
Used used(const tinygltf::Value* object, const char* name);

class TextureMaker {
public:
    /// `material` and its name for messages.
    TextureMaker(Context& context, int material, std::string what)
        : c_(context), material_(material), what_(std::move(what)) {}

    /// The same, or none where the file gives the texture no image.
    Used with_image(const Used& use);
    /// Bitmap of a texture. `channel`: "r" to "a", or all.
    Object& bitmap(const Used& use, bool raw, const char* channel = "");
    /// Normals whose slopes are `scale` times as steep.
    Object& normals(const Used& use, double scale);
    /// 1 where alpha times `factor` reaches `cutoff`, else 0.
    Object& cut_alpha(const Used& use, double factor, double cutoff);
    const Object& scaled(const Object& texture, Rgb factor);
    /// Of all texels, colours decoded unless `raw`.
    Rgb mean(const Used& use, bool raw);
    /// The set of coordinates that its textures use.
    int tex_coord() const { return std::max(tex_coord_, 0); }

private:
    Object& object(const char* tag, const char* type) { return mitsuba::add_object(c_.document, tag, type, c_.where); }
    const std::string& image(int index);
    Object& bitmap_of(const Used& use, std::string image);
    bool lies_in_unit(int set, int axis) const;
    Texels& derived(const std::string& name, const Texels& source, uint32_t width, uint32_t height, bool is_8bit);
    std::string mirrored(const std::string& name, int axis);
    std::string steeper(const std::string& name, double scale);

    Context& c_;
    int material_;
    std::string what_;
    int tex_coord_ = -1;
};

}  // namespace ambilux::gltf
