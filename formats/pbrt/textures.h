// Textures of pbrt: folded into constants, checkerboards and images, which are what a Document can hold.
#pragma once

#include <functional>

#include "formats/pbrt/projection.h"
#include "formats/pbrt/spectra.h"

namespace ambilux::pbrt {

using document::Object;

/// Affine map of the plane, by rows.
struct UvMap {
    double m[2][3] = {{1, 0, 0}, {0, 1, 0}};
    bool operator==(const UvMap&) const = default;
};
/// `a` after `b`.
UvMap operator*(const UvMap& a, const UvMap& b);

/// Linear colours, row 0 at the top: of a file, read when they are needed, or made here.
struct TextureImage {
    std::string path;        ///< of the file, or empty
    double gamma = 0;        ///< of the file's values: 0 as its format has it, -1 sRGB, or a power
    bool is_number = false;  ///< texels are grey: alpha of files that have it, else the mean of the colours
    bool is_file = true;     ///< a lookup in the file gives the texels
    uint32_t width = 0, height = 0;
    std::vector<Rgb> texels;
};

/// One that is made here, without texels yet.
std::shared_ptr<TextureImage> made_image(uint32_t width, uint32_t height);

/// A point of a surface where a texture is asked for.
struct SurfacePlace {
    Vec3d p;              ///< in the world
    Vec3d n;              ///< unit geometric normal, of either side
    double u = 0, v = 0;  ///< pbrt's coordinates of the shape
};
using SolidFunction = std::function<Rgb(const SurfacePlace&)>;

/// A texture whose inner textures are folded into it.
struct Texture {
    /// A solid texture has values at places of the world, not of the plane.
    enum class Kind { constant, checkerboard, image, solid };
    Kind kind = Kind::constant;
    Where where;
    Rgb color = {1, 1, 1};                         ///< constant; of the cells with an even sum; factor of the image
    Rgb odd{};                                     ///< of the other cells
    UvMap mapping;                                 ///< from pbrt's (u,v) to its (s,t)
    std::shared_ptr<const Projection> projection;  ///< gives (s,t) instead, or null
    std::string wrap = "repeat", filter = "bilinear";
    std::shared_ptr<TextureImage> image;
    std::shared_ptr<const SolidFunction> solid;  ///< `color` is a factor of it
    double detail = 0;                           ///< of a solid: length in the world over which it changes

    bool is_constant() const { return kind == Kind::constant; }
};

/// The image of a file, which is not read yet.
Texture texture_of_file(const std::string& path, const Where& where);

using ColorMap = std::function<Rgb(Rgb)>;

/// What a texture object was made of.
struct MadeTexture {
    Texture texture;
    ColorMap map;

    Rgb at(const SurfacePlace& place) const;
};

/// Value at a place; images must have texels.
Rgb evaluate(const Texture& texture, const SurfacePlace& place);

class Textures {
public:
    Textures(SpectrumReader spectra, document::Document& document, Report& report)
        : spectra_(spectra), document_(document), report_(report) {}

    const SpectrumReader& spectra() const { return spectra_; }

    /// Directive Texture; `ctm` places it in the world.
    void define(const std::string& name, bool is_float, const Parameters& in, ColorSpace space,
                const document::Matrix& ctm);

    /// Parameters that are numbers or textures of them, colours or textures of them.
    Texture number(const Parameters& in, const std::string& name, double fallback) const;
    Texture color(const Parameters& in, const std::string& name, Rgb fallback, ColorUse use, ColorSpace space) const;
    /// One of the two, of a texture that is made of others.
    Texture part(bool is_float, const Parameters& in, const char* name, double fallback, ColorSpace space) const;

    /// Sets a parameter of `object`. `uv`: from coordinates of the shape to pbrt's (u,v). Numbers pass `map` first.
    void set_number(Object& object, const std::string& name, const Texture& texture, const UvMap& uv,
                    const std::function<double(double)>& map = {});
    /// Reflectances are clipped at 1, as in pbrt.
    void set_color(Object& object, const std::string& name, const Texture& texture, const UvMap& uv);
    /// Of all texels or cells.
    double mean(const Texture& texture) const;
    /// Its image, with texels.
    const TextureImage& texels_of(const Texture& texture) const;
    /// The texture as an object of its own.
    const Object& object(const Texture& texture, const UvMap& uv, const ColorMap& map = {});
    /// What gives all textures below `object` their coordinates: null if the shape does. Refused if they differ.
    std::shared_ptr<const Projection> projection_of(const Object& object) const;
    /// Whether a solid texture lies below `object`, which is to be replaced then (bake_solids).
    bool has_solid(const Object& object) const;
    /// What the object of a texture was made of, with texels; null for other objects.
    const MadeTexture* made(const Object& object) const;

private:
    Texture build(bool is_float, const Parameters& in, ColorSpace space);
    Texture image_texture(bool is_float, const Parameters& in);
    Texture fold(const Parameters& in, const std::vector<Texture>& parts,
                 const std::function<Rgb(const std::vector<Rgb>&)>& f);
    Texture on_one_grid(const Parameters& in, const std::vector<Texture>& parts,
                        const std::function<Rgb(const std::vector<Rgb>&)>& f);
    Texture bilerp(bool is_float, const Parameters& in, ColorSpace space) const;
    Texture dots(const Parameters& in) const;
    Texture solid(bool is_float, const Parameters& in, ColorSpace space);
    Texture solid_of(const Where& where, const std::vector<Texture>& parts,
                     const std::function<Rgb(const std::vector<Rgb>&, const SurfacePlace&)>& f) const;
    static double mean_of_solid(const Texture& texture);
    void set_mapping(Texture& texture, const Parameters& in) const;
    const Texture& named(const Parameter& p, bool is_float) const;
    std::shared_ptr<TextureImage> image_file(const std::string& path, double gamma, bool is_number);
    void load_texels(TextureImage& image) const;
    std::string bake(const Texture& texture, const ColorMap& map);

    SpectrumReader spectra_;
    document::Document& document_;
    Report& report_;
    std::map<std::string, Texture> colors_, numbers_;
    std::map<std::string, std::shared_ptr<TextureImage>> images_;
    std::map<const Object*, std::shared_ptr<const Projection>> projections_;  ///< of textures as objects
    std::map<const Object*, MadeTexture> made_;
    document::Matrix ctm_;  ///< of the texture being defined
};

}  // namespace ambilux::pbrt
