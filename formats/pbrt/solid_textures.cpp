// Textures that have values at places of the world: fbm, windy, wrinkled, marble, checkerboards of three dimensions;
// and directionmix, whose values depend on the normal.
#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/pbrt/noise.h"
#include "formats/pbrt/textures.h"

namespace ambilux::pbrt {

using document::Matrix;
using document::transformed;

namespace {

/// Colour of pbrt's marble for t in [0,1]: cubic Bezier curves through colours of a photograph.
Rgb marble_color(double t) {
    constexpr Rgb grey = {0.58f, 0.58f, 0.6f};
    constexpr Rgb colors[9] = {
        grey, grey, grey, {0.5f, 0.5f, 0.5f}, {0.6f, 0.59f, 0.58f}, grey, grey, {0.2f, 0.2f, 0.33f}, grey};
    constexpr int segments = 6;
    const int first = std::clamp(int(std::floor(t * segments)), 0, segments - 1);
    const float x = float(t * segments - first), y = 1 - x;
    const Rgb* c = colors + first;
    return (c[0] * (y * y * y) + c[1] * (3 * y * y * x) + c[2] * (3 * y * x * x) + c[3] * (x * x * x)) * 1.5f;
}

/// Length of the finest octave's cells.
double finest(int octaves) { return std::pow(kLacunarity, 1 - octaves); }

}  // namespace

Texture Textures::solid(bool is_float, const Parameters& in, ColorSpace space) {
    if (!(std::fabs(document::determinant(ctm_)) > 0)) fail(in.where, "the transform of the texture is singular");
    const Matrix to_texture = document::affine_inverse(ctm_);
    const auto part = [&](const char* name, double v) { return this->part(is_float, in, name, v, space); };
    if (in.type == "checkerboard") {
        Texture out = solid_of(in.where, {part("tex1", 1), part("tex2", 0)},
                               [to_texture](const std::vector<Rgb>& c, const SurfacePlace& place) {
                                   const Vec3d p = transformed(to_texture, place.p);
                                   const double sum = std::floor(p.x) + std::floor(p.y) + std::floor(p.z);
                                   return std::fmod(sum, 2) == 0 ? c[0] : c[1];
                               });
        out.detail = std::min(out.detail, std::cbrt(std::fabs(document::determinant(ctm_))) / 4);
        return out;
    }
    if (in.type == "directionmix") {
        Vec3d axis = transformed(ctm_, in.point("dir", {0, 1, 0}), 0);
        if (!(length(axis) > 0)) fail(in.where_of("dir"), "a directionmix needs a direction");
        axis = axis * (1 / length(axis));
        return solid_of(in.where, {part("tex1", 0), part("tex2", 1)},
                        [axis](const std::vector<Rgb>& c, const SurfacePlace& place) {
                            const float amount = float(std::fabs(dot(place.n, axis)));
                            return c[0] * amount + c[1] * (1 - amount);
                        });
    }
    const int octaves = in.type == "windy" ? 6 : int(std::clamp<int64_t>(in.integer("octaves", 8), 0, 32));
    const double omega = in.type == "windy" ? 0.5 : in.number("roughness", 0.5);
    const double scale = in.type == "marble" ? in.number("scale", 1) : 1;
    const double variation = in.type == "marble" ? in.number("variation", 0.2) : 0;
    const std::string type = in.type;
    Texture out;
    out.kind = Texture::Kind::solid;
    out.where = in.where;
    out.detail = std::cbrt(std::fabs(document::determinant(ctm_))) * finest(octaves) / std::max(std::fabs(scale), 1e-9);
    out.solid = std::make_shared<const SolidFunction>([=](const SurfacePlace& place) {
        const Vec3d p = transformed(to_texture, place.p) * scale;
        if (type == "fbm") return splat(float(fbm(p, omega, octaves)));
        if (type == "wrinkled") return splat(float(turbulence(p, omega, octaves)));
        if (type == "windy") return splat(float(std::fabs(fbm(p * 0.1, 0.5, 3)) * fbm(p, omega, octaves)));
        return marble_color(0.5 + 0.5 * std::sin(p.y + variation * fbm(p, omega, octaves)));
    });
    return out;
}

/// A solid texture of others, of which some may be of the plane.
Texture Textures::solid_of(const Where& where, const std::vector<Texture>& parts,
                           const std::function<Rgb(const std::vector<Rgb>&, const SurfacePlace&)>& f) const {
    Texture out;
    out.kind = Texture::Kind::solid;
    out.where = where;
    out.detail = std::numeric_limits<double>::infinity();
    for (const Texture& part : parts) {
        if (part.kind == Texture::Kind::image) load_texels(*part.image);
        if (part.kind == Texture::Kind::solid) out.detail = std::min(out.detail, part.detail);
    }
    out.solid = std::make_shared<const SolidFunction>([parts, f](const SurfacePlace& place) {
        std::vector<Rgb> values;
        for (const Texture& part : parts) values.push_back(evaluate(part, place));
        return f(values, place);
    });
    return out;
}

/// Over a cube of the world, seen from all sides: of where the surfaces are it knows nothing.
double Textures::mean_of_solid(const Texture& texture) {
    constexpr int kSide = 16;
    double sum = 0;
    for (int i = 0; i < kSide; ++i)
        for (int j = 0; j < kSide; ++j)
            for (int k = 0; k < kSide; ++k) {
                // Irrational steps, so that lattices of noise and checkerboards are not met in step.
                const double x = i * M_SQRT2 - 11, y = j * std::sqrt(3) - 13, z = k * M_PI / 2 - 12;
                const double l = std::max(std::sqrt(x * x + y * y + z * z), 1e-9);
                sum += evaluate(texture, {{x, y, z}, {x / l, y / l, z / l}, i / double(kSide), j / double(kSide)}).x;
            }
    return sum / (kSide * kSide * kSide);
}

bool Textures::has_solid(const Object& object) const {
    bool found = false;
    document::for_all_below(object, [&](const Object& o) { found |= o.tag == "texture" && o.type == "solid"; });
    return found;
}

Rgb MadeTexture::at(const SurfacePlace& place) const {
    const Rgb value = evaluate(texture, place);
    return map ? map(value) : value;
}

const MadeTexture* Textures::made(const Object& object) const {
    const auto it = made_.find(&object);
    if (it == made_.end()) return nullptr;
    if (it->second.texture.kind == Texture::Kind::image) load_texels(*it->second.texture.image);
    return &it->second;
}

}  // namespace ambilux::pbrt
