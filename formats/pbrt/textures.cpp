#include "formats/pbrt/textures.h"
#include "formats/document/plugins.h"
#include "formats/pbrt/names.h"

#include <algorithm>
#include <cmath>

namespace ambilux::pbrt {

UvMap operator*(const UvMap& a, const UvMap& b) {
    UvMap c;
    for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 3; ++j) c.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j];
        c.m[i][2] += a.m[i][2];
    }
    return c;
}

void Textures::define(const std::string& name, bool is_float, const Parameters& in, ColorSpace space,
                      const document::Matrix& ctm) {
    ctm_ = ctm;
    auto& known = is_float ? numbers_ : colors_;
    if (known.contains(name)) fail(in.where, "texture '" + name + "' is defined twice");
    const Texture texture = build(is_float, in, space);
    in.finish(report_);
    known[name] = texture;
}

const Texture& Textures::named(const Parameter& p, bool is_float) const {
    if (p.strings.size() != 1) fail(p.where, "'" + p.name + "' must be the name of one texture");
    const auto& known = is_float ? numbers_ : colors_;
    const auto it = known.find(p.strings[0]);
    if (it == known.end())
        fail(p.where, "no texture of type " + std::string(is_float ? "float" : "spectrum") + " is known by the name '" +
                          p.strings[0] + "'" + suggestion(known, p.strings[0]));
    return it->second;
}

Texture Textures::number(const Parameters& in, const std::string& name, double fallback) const {
    const Parameter* p = in.find(name);
    if (p && p->is_texture()) return named(*p, true);
    Texture texture;
    texture.where = in.where_of(name);
    texture.color = splat(float(in.number(name, fallback)));
    return texture;
}

Texture Textures::color(const Parameters& in, const std::string& name, Rgb fallback, ColorUse use,
                        ColorSpace space) const {
    const Parameter* p = in.find(name);
    if (p && p->is_texture()) return named(*p, false);
    Texture texture;
    texture.where = in.where_of(name);
    texture.color = p ? spectra_.color(*p, use, space) : fallback;
    return texture;
}

Texture Textures::part(bool is_float, const Parameters& in, const char* name, double fallback, ColorSpace space) const {
    return is_float ? number(in, name, fallback)
                    : color(in, name, splat(float(fallback)), ColorUse::reflectance, space);
}

std::shared_ptr<TextureImage> made_image(uint32_t width, uint32_t height) {
    auto image = std::make_shared<TextureImage>();
    image->is_file = false;
    image->width = width, image->height = height;
    image->texels.reserve(size_t(width) * height);
    return image;
}

Texture texture_of_file(const std::string& path, const Where& where) {
    Texture texture;
    texture.kind = Texture::Kind::image;
    texture.where = where;
    texture.image = std::make_shared<TextureImage>();
    texture.image->path = path;
    return texture;
}

void Textures::set_mapping(Texture& texture, const Parameters& in) const {
    const std::string kind = in.text("mapping", "uv");
    if (kind == "uv") {
        texture.mapping.m[0][0] = in.number("uscale", 1), texture.mapping.m[0][2] = in.number("udelta", 0);
        texture.mapping.m[1][1] = in.number("vscale", 1), texture.mapping.m[1][2] = in.number("vdelta", 0);
        return;
    }
    Projection projection;
    if (kind == "planar") {
        projection.v1 = in.point("v1", projection.v1), projection.v2 = in.point("v2", projection.v2);
        projection.ds = in.number("udelta", 0), projection.dt = in.number("vdelta", 0);
    } else if (kind == "cylindrical") {
        projection.kind = Projection::Kind::cylindrical;
    } else if (kind == "spherical") {
        projection.kind = Projection::Kind::spherical;
    } else {
        fail(in.where_of("mapping"), "unknown texture mapping '" + kind + "': uv, planar, cylindrical, spherical");
    }
    if (!(std::fabs(document::determinant(ctm_)) > 0)) fail(in.where, "the transform of the texture is singular");
    projection.to_texture = document::affine_inverse(ctm_);
    if (kind != "planar")
        report_.note(in.where, "coordinates of cylindrical and spherical mappings are linear over each triangle");
    texture.projection = std::make_shared<const Projection>(projection);
}

std::shared_ptr<const Projection> Textures::projection_of(const Object& object) const {
    std::shared_ptr<const Projection> found;
    bool any = false, mixed = false;
    document::for_all_below(object, [&](const Object& o) {
        const auto it = projections_.find(&o);
        if (it == projections_.end()) return;
        const bool same = found && it->second ? *found == *it->second : found == it->second;
        mixed |= any && !same;
        if (!any) found = it->second;
        any = true;
    });
    if (mixed)
        report_.refuse(object.where, "textures of different mappings on one surface are not supported",
                       "all have the coordinates of the first");
    return found;
}

Texture Textures::build(bool is_float, const Parameters& in, ColorSpace space) {
    const auto part = [&](const char* name, double v) { return this->part(is_float, in, name, v, space); };
    Texture out;
    out.where = in.where;
    if (in.type == "constant") {
        out.color = part("value", 1).color;
    } else if (in.type == "scale") {
        const Texture tex = part("tex", 1), scale = number(in, "scale", 1);
        if (scale.is_constant() && tex.kind == Texture::Kind::image)
            out = tex, out.color *= scale.color;
        else
            out = fold(in, {tex, scale}, [](const std::vector<Rgb>& c) { return c[0] * c[1]; });
    } else if (in.type == "mix") {
        out = fold(in, {part("tex1", 0), part("tex2", 1), number(in, "amount", 0.5)},
                   [](const std::vector<Rgb>& c) { return c[0] * (splat(1) - c[2]) + c[1] * c[2]; });
    } else if (in.type == "checkerboard") {
        if (in.integer("dimension", 2) == 3) return solid(is_float, in, space);
        if (in.integer("dimension", 2) != 2) fail(in.where_of("dimension"), "a checkerboard has 2 or 3 dimensions");
        const Texture even = part("tex1", 1), odd = part("tex2", 0);
        out.kind = Texture::Kind::checkerboard;
        set_mapping(out, in);
        out.color = even.color, out.odd = odd.color;
        if (!even.is_constant() || !odd.is_constant()) {
            out.color = splat(1), out.odd = splat(0);
            out = fold(in, {even, odd, out}, [](const std::vector<Rgb>& c) { return c[2].x > 0.5f ? c[0] : c[1]; });
        }
    } else if (in.type == "bilerp") {
        out = bilerp(is_float, in, space);
    } else if (in.type == "dots") {
        out = fold(in, {part("inside", 1), part("outside", 0), dots(in)},
                   [](const std::vector<Rgb>& c) { return c[0] * c[2] + c[1] * (splat(1) - c[2]); });
    } else if (in.type == "imagemap") {
        out = image_texture(is_float, in);
    } else if (in.type == "directionmix" || (in.type == "marble" && !is_float) ||
               (is_float && (in.type == "fbm" || in.type == "windy" || in.type == "wrinkled"))) {
        out = solid(is_float, in, space);
    } else {
        report_.refuse(in.where, not_supported("texture type", in.type), "a grey of 0.5 is used");
        out.color = splat(0.5f);
        for (const Parameter& p : in.list) p.used = true;
    }
    return out;
}

Texture Textures::image_texture(bool is_float, const Parameters& in) {
    Texture out;
    out.kind = Texture::Kind::image;
    out.where = in.where;
    const std::string path = resolve(spectra_.folder, in.filename(), in.where_of("filename"));
    const std::string encoding = in.text("encoding", "");
    double gamma = 0;  // of files that are not PNG, what their format implies
    if (path.ends_with(".png") || path.ends_with(".PNG")) {
        gamma = encoding.empty() || encoding == "sRGB" ? -1 : encoding == "linear" ? 1 : 0;
        if (gamma == 0 && !(encoding.starts_with("gamma ") && parse_number(encoding.substr(6), gamma) && gamma > 0))
            fail(in.where_of("encoding"), "unknown encoding '" + encoding + "'");
    }
    out.image = image_file(path, gamma, is_float);
    set_mapping(out, in);
    out.wrap = in.text("wrap", "repeat");
    if (out.wrap != "repeat" && out.wrap != "clamp") {
        report_.refuse(in.where_of("wrap"), "wrap mode '" + out.wrap + "' is not supported", "repeat is used");
        out.wrap = "repeat";
    }
    const std::string filter = in.text("filter", "bilinear");
    if (filter != "point" && filter != "bilinear" && filter != "trilinear" && filter != "EWA" && filter != "ewa")
        fail(in.where_of("filter"), "unknown texture filter '" + filter + "'");
    out.filter = filter == "point" ? "nearest" : "bilinear";
    in.ignore({"maxanisotropy"});  // of filters that need differentials
    const float scale = float(in.number("scale", 1));
    if (!is_float && !(scale >= 0)) fail(in.where_of("scale"), "the scale of a colour must not be negative");
    out.color = splat(scale);
    if (!in.boolean("invert", false)) return out;
    return fold(in, {out}, [](const std::vector<Rgb>& c) { return max(splat(1) - c[0], splat(0)); });
}

std::shared_ptr<TextureImage> Textures::image_file(const std::string& path, double gamma, bool is_number) {
    auto& known = images_[path + "|" + std::to_string(gamma) + (is_number ? "|number" : "")];
    if (known) return known;
    known = std::make_shared<TextureImage>();
    known->path = path;
    known->gamma = gamma;
    known->is_number = is_number;
    // Whether a file holds numbers as they are asked for is seen in it only.
    if (is_number) load_texels(*known);
    return known;
}

void Textures::load_texels(TextureImage& image) const {
    if (!image.texels.empty()) return;
    const Texels texels = document::read_image_file(document_, image.path);
    FileBudget(image.path, document_.limits).bytes(uint64_t(texels.width) * texels.height, sizeof(Rgb));
    image.width = texels.width, image.height = texels.height;
    const double gamma = image.gamma != 0 ? image.gamma : texels.is_linear ? 1 : -1;
    double table[256];
    for (int i = 0; i < 256; ++i) table[i] = decoded(i / 255.0, gamma);
    const auto value = [&](size_t i) {
        return float(texels.is_8bit ? table[texels.bytes[i]] : decoded(texels.floats[i], gamma));
    };
    const size_t count = size_t(texels.width) * texels.height;
    bool has_alpha = false, is_grey = true;
    image.texels.resize(count);
    for (size_t i = 0; i < count; ++i) {
        Rgb& c = image.texels[i];
        c = {value(4 * i), value(4 * i + 1), value(4 * i + 2)};
        if (!is_finite(c)) fail({image.path, 0}, "texel " + std::to_string(i) + " is not finite");
        has_alpha |= value(4 * i + 3) != 1;
        is_grey &= c.x == c.y && c.x == c.z;
    }
    if (!image.is_number) return;
    image.is_file = is_grey && !has_alpha;
    for (size_t i = 0; i < count; ++i) {
        const Rgb c = image.texels[i];
        image.texels[i] = splat(has_alpha ? value(4 * i + 3) : (c.x + c.y + c.z) / 3);
    }
}

std::string Textures::bake(const Texture& texture, const ColorMap& map) {
    load_texels(*texture.image);
    const TextureImage& image = *texture.image;
    document::take_texels(document_, texture.where, image.texels.size(), 16);
    const std::string name = texture.where.text() + "#" + std::to_string(document_.images.size());
    Texels& out = document::add_image(document_, name, image.width, image.height);
    for (size_t i = 0; i < image.texels.size(); ++i) {
        const Rgb c = texture.color * image.texels[i], mapped = map ? map(c) : c;
        for (int k = 0; k < 3; ++k) out.floats[4 * i + size_t(k)] = mapped[k];
    }
    return name;
}

const Object& Textures::object(const Texture& texture, const UvMap& uv, const ColorMap& map) {
    using namespace document;
    UvMap to_uv = texture.projection ? texture.mapping : texture.mapping * uv;
    Object* object = nullptr;
    Rgb factor = splat(1);
    if (texture.kind == Texture::Kind::solid) {
        object = &add_object(document_, "texture", "solid", texture.where);
        made_[object] = {texture, map};
        return *object;
    }
    if (texture.kind == Texture::Kind::image) {
        // Images lie upside down in pbrt's (s,t).
        to_uv = UvMap{{{1, 0, 0}, {0, -1, 1}}} * to_uv;
        object = &add_object(document_, "texture", "bitmap", texture.where);
        if (texture.image->is_file && !map) {
            set_text(*object, "filename", texture.image->path);
            document::set_number(*object, "gamma", texture.image->gamma);
            factor = texture.color;
        } else {
            set_text(*object, "image", bake(texture, map));
            set_boolean(*object, "raw", true);
        }
        set_text(*object, "wrap_mode", texture.wrap);
        set_text(*object, "filter_type", texture.filter);
    } else {
        const auto mapped = [&](Rgb c) { return map ? map(c) : c; };
        const Rgb even = mapped(texture.color), odd = texture.is_constant() ? even : mapped(texture.odd);
        const float most = std::max({1.0f, max_component(even), max_component(odd)});
        factor = splat(most);
        // A period of two cells of size 1 is the unit square of a checkerboard.
        to_uv = UvMap{{{0.5, 0, 0}, {0, 0.5, 0}}} * to_uv;
        object = &add_object(document_, "texture", "checkerboard", texture.where);
        set_rgb(*object, "color0", even / most);
        set_rgb(*object, "color1", odd / most);
    }
    Matrix m;
    const int columns[3] = {0, 1, 3};
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 3; ++j) m.m[i][columns[j]] = to_uv.m[i][j];
    set_transform(*object, "to_uv", m);
    projections_[object] = texture.projection;
    if (factor == splat(1)) {
        made_[object] = {texture, map};
        return *object;
    }
    Object& scaled = add_object(document_, "texture", "scale", texture.where);
    set_rgb(scaled, "scale", factor);
    add_child(scaled, *object);
    made_[&scaled] = {texture, map};
    return scaled;
}

void Textures::set_number(Object& object, const std::string& name, const Texture& texture, const UvMap& uv,
                          const std::function<double(double)>& map) {
    if (texture.is_constant()) {
        const double value = texture.color.x;
        return document::set_number(object, name, map ? map(value) : value);
    }
    const ColorMap each = [&](Rgb c) { return splat(float(map(c.x))); };
    document::add_child(object, this->object(texture, uv, map ? each : ColorMap{}), name);
}

void Textures::set_color(Object& object, const std::string& name, const Texture& texture, const UvMap& uv) {
    if (texture.is_constant()) return document::set_rgb(object, name, texture.color);
    const bool beyond = texture.kind == Texture::Kind::solid ||
                        (texture.kind == Texture::Kind::image && max_component(texture.color) > 1);
    const ColorMap clip = [](Rgb c) { return max(min(c, splat(1)), splat(0)); };
    document::add_child(object, this->object(texture, uv, beyond ? clip : ColorMap{}), name);
}

const TextureImage& Textures::texels_of(const Texture& texture) const {
    load_texels(*texture.image);
    return *texture.image;
}

double Textures::mean(const Texture& texture) const {
    if (texture.is_constant()) return texture.color.x;
    if (texture.kind == Texture::Kind::checkerboard) return 0.5 * (double(texture.color.x) + texture.odd.x);
    if (texture.kind == Texture::Kind::solid) return mean_of_solid(texture);
    load_texels(*texture.image);
    double sum = 0;
    for (const Rgb& c : texture.image->texels) sum += c.x;
    return texture.color.x * sum / double(texture.image->texels.size());
}

}  // namespace ambilux::pbrt
