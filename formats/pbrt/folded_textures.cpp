// Textures of textures, which become one.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "formats/pbrt/textures.h"

namespace ambilux::pbrt {

namespace {

/// Texels a side of a grid.
constexpr uint64_t kMostFolded = 4096;

bool is_whole(double x) { return std::fabs(x - std::round(x)) < 1e-6; }

/// (s,t) of a texture from that of the grid: per axis a whole number of its periods, and a shift.
struct Axis {
    double scale = 1, shift = 0;
};
struct Placed {
    Axis s, t;
};

bool same_projection(const Texture& a, const Texture& b) {
    return a.projection && b.projection ? *a.projection == *b.projection : a.projection == b.projection;
}

/// False if a grid with coordinates `grid` holds no whole number of periods of the texture.
bool place(const Texture& texture, const UvMap& grid, Placed& out) {
    const auto& a = texture.mapping.m;
    const auto& b = grid.m;
    for (const UvMap* map : {&texture.mapping, &grid})
        if (map->m[0][1] != 0 || map->m[1][0] != 0 || map->m[0][0] == 0 || map->m[1][1] == 0) return false;
    out.s.scale = a[0][0] / b[0][0], out.t.scale = a[1][1] / b[1][1];
    out.s.shift = a[0][2] - out.s.scale * b[0][2], out.t.shift = a[1][2] - out.t.scale * b[1][2];
    // Cells of a checkerboard repeat after two.
    const double period = texture.kind == Texture::Kind::checkerboard ? 2 : 1;
    if (!(std::fabs(out.s.scale) <= double(kMostFolded) && std::fabs(out.t.scale) <= double(kMostFolded))) return false;
    return is_whole(out.s.scale / period) && is_whole(out.t.scale / period);
}

Rgb lookup(const Texture& texture, double s, double t) {
    if (texture.is_constant()) return texture.color;
    if (texture.kind == Texture::Kind::checkerboard) {
        const double sum = std::floor(s) + std::floor(t);
        return std::fmod(sum, 2) == 0 ? texture.color : texture.odd;
    }
    const TextureImage& image = *texture.image;
    const int64_t w = image.width, h = image.height;
    const auto texel = [&](int64_t x, int64_t y) {
        const auto wrapped = [&](int64_t i, int64_t n) {
            return texture.wrap == "clamp" ? std::clamp<int64_t>(i, 0, n - 1) : (i % n + n) % n;
        };
        return texture.color * image.texels[size_t(wrapped(y, h) * w + wrapped(x, w))];
    };
    // Images lie upside down in pbrt's (s,t).
    const double x = s * double(w), y = (1 - t) * double(h);
    if (texture.filter == "nearest") return texel(int64_t(std::floor(x)), int64_t(std::floor(y)));
    const double x0 = std::floor(x - 0.5), y0 = std::floor(y - 0.5);
    const float fx = float(x - 0.5 - x0), fy = float(y - 0.5 - y0);
    const int64_t i = int64_t(x0), j = int64_t(y0);
    return (texel(i, j) * (1 - fx) + texel(i + 1, j) * fx) * (1 - fy) +
           (texel(i, j + 1) * (1 - fx) + texel(i + 1, j + 1) * fx) * fy;
}

/// Texels along an axis on which edges of checkerboards fall, as fine as the finest image.
uint32_t grid_size(const std::vector<Texture>& parts, const std::vector<Placed>& places, Axis Placed::* axis,
                   uint32_t TextureImage::* side) {
    uint64_t cells = 1, finest = 1;
    for (size_t i = 0; i < parts.size(); ++i) {
        const uint64_t periods = uint64_t(std::lround(std::fabs((places[i].*axis).scale)));
        if (parts[i].kind == Texture::Kind::checkerboard)
            cells = std::min(std::lcm(cells, std::max<uint64_t>(periods, 1)), kMostFolded);
        else if (!parts[i].is_constant())
            finest = std::max(finest, periods * ((*parts[i].image).*side));
    }
    // Beside a checkerboard an image of one texel would blur its edges.
    const uint64_t wanted = std::min(std::max(finest, cells > 1 ? 16 * cells : 1), kMostFolded);
    return uint32_t(std::max(cells, wanted / cells * cells));
}

/// One period of `parts`, put together by `f`.
std::shared_ptr<TextureImage> image_of(const std::vector<Texture>& parts, const std::vector<Placed>& places,
                                       FileBudget budget, const std::function<Rgb(const std::vector<Rgb>&)>& f) {
    const uint32_t width = grid_size(parts, places, &Placed::s, &TextureImage::width),
                   height = grid_size(parts, places, &Placed::t, &TextureImage::height);
    budget.bytes(uint64_t(width) * height, sizeof(Rgb));
    const auto image = made_image(width, height);
    std::vector<Rgb> values(parts.size());
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            const double s = (x + 0.5) / width, t = 1 - (y + 0.5) / height;
            for (size_t i = 0; i < parts.size(); ++i)
                values[i] = lookup(parts[i], places[i].s.scale * s + places[i].s.shift,
                                   places[i].t.scale * t + places[i].t.shift);
            image->texels.push_back(f(values));
        }
    return image;
}

}  // namespace

Rgb evaluate(const Texture& texture, const SurfacePlace& place) {
    if (texture.is_constant()) return texture.color;
    if (texture.kind == Texture::Kind::solid) return texture.color * (*texture.solid)(place);
    double s = place.u, t = place.v;
    if (texture.projection) {
        const Vec2f st = coordinates(*texture.projection, place.p);
        s = double(st.x), t = double(st.y);
    }
    const auto& m = texture.mapping.m;
    return lookup(texture, m[0][0] * s + m[0][1] * t + m[0][2], m[1][0] * s + m[1][1] * t + m[1][2]);
}

Texture Textures::fold(const Parameters& in, const std::vector<Texture>& parts,
                       const std::function<Rgb(const std::vector<Rgb>&)>& f) {
    Texture out;
    // The kind of the first that is no constant, whose coordinates all others must have.
    const Texture* model = nullptr;
    bool fits = true;
    for (const Texture& part : parts)
        if (part.kind == Texture::Kind::solid)
            return solid_of(in.where, parts, [f](const std::vector<Rgb>& c, const SurfacePlace&) { return f(c); });
    for (const Texture& part : parts) {
        if (part.is_constant()) continue;
        if (part.kind == Texture::Kind::image) load_texels(*part.image);
        if (!model) model = &part;
        fits &= part.kind == model->kind && part.mapping == model->mapping && part.wrap == model->wrap &&
                part.filter == model->filter && same_projection(part, *model);
        if (fits && model->image)
            fits = part.image->width == model->image->width && part.image->height == model->image->height;
    }
    if (!fits) return on_one_grid(in, parts, f);
    std::vector<Rgb> values(parts.size());
    const auto combine = [&](const std::function<Rgb(const Texture&)>& value) {
        for (size_t i = 0; i < parts.size(); ++i) values[i] = parts[i].is_constant() ? parts[i].color : value(parts[i]);
        return f(values);
    };
    if (model) out = *model;
    out.where = in.where;
    if (out.kind != Texture::Kind::image) {
        out.color = combine([](const Texture& t) { return t.color; });
        out.odd = combine([](const Texture& t) { return t.odd; });
        return out;
    }
    out.image = made_image(model->image->width, model->image->height);
    for (size_t i = 0; i < model->image->texels.size(); ++i)
        out.image->texels.push_back(combine([i](const Texture& t) { return t.color * t.image->texels[i]; }));
    out.color = splat(1);
    return out;
}

/// Of textures of different kinds, sizes or coordinates: an image of the period that all of them have.
Texture Textures::on_one_grid(const Parameters& in, const std::vector<Texture>& parts,
                              const std::function<Rgb(const std::vector<Rgb>&)>& f) {
    Texture out;
    out.where = in.where;
    std::vector<Placed> places(parts.size());
    // The coordinates of the texture with the longest period, twice as long if there are checkerboards.
    const Texture* longest = nullptr;
    bool checkered = false, fits = true, nearest = true;
    for (const Texture& part : parts) {
        if (part.is_constant()) continue;
        checkered |= part.kind == Texture::Kind::checkerboard;
        const auto density = [](const Texture& t) { return std::fabs(t.mapping.m[0][0] * t.mapping.m[1][1]); };
        if (!longest || density(part) < density(*longest)) longest = &part;
        if (part.kind == Texture::Kind::image) nearest &= part.filter == "nearest";
    }
    UvMap grid = longest->mapping;
    if (checkered)
        for (auto& row : grid.m)
            for (double& v : row) v /= 2;
    bool repeats = true, same = !checkered;
    for (size_t i = 0; i < parts.size(); ++i) {
        if (parts[i].is_constant()) continue;
        repeats &= parts[i].wrap == "repeat";
        same &= parts[i].wrap == longest->wrap && parts[i].mapping == grid;
        fits &= place(parts[i], grid, places[i]) && same_projection(parts[i], *longest);
    }
    fits &= repeats || same;
    if (!fits) {
        report_.refuse(
            in.where,
            "a texture of type '" + in.type + "' of textures whose periods do not fit into each other is not supported",
            "constants are put in for them");
        std::vector<Rgb> values(parts.size());
        for (size_t i = 0; i < parts.size(); ++i) values[i] = parts[i].color;
        out.color = f(values);
        return out;
    }
    report_.note(in.where,
                 "textures of textures of different kinds, sizes or coordinates are put on one grid of texels");
    out.kind = Texture::Kind::image;
    out.mapping = grid;
    out.projection = longest->projection;
    out.wrap = longest->wrap;
    out.filter = nearest ? "nearest" : "bilinear";
    out.image = image_of(parts, places, FileBudget(in.where.file, document_.limits), f);
    return out;
}

/// An image of 2x2 texels, whose centres are the corners of the unit square.
Texture Textures::bilerp(bool is_float, const Parameters& in, ColorSpace space) const {
    Texture out;
    out.kind = Texture::Kind::image;
    out.where = in.where;
    set_mapping(out, in);
    out.mapping = UvMap{{{0.5, 0, 0.25}, {0, 0.5, 0.25}}} * out.mapping;
    out.wrap = "clamp";
    out.image = made_image(2, 2);
    const std::pair<const char*, double> corners[4] = {{"v01", 1}, {"v11", 1}, {"v00", 0}, {"v10", 0}};
    for (const auto& [name, fallback] : corners) {
        const Texture corner = part(is_float, in, name, fallback, space);
        if (!corner.is_constant()) fail(in.where_of(name), "corners of a bilerp must be constants");
        out.image->texels.push_back(corner.color);
    }
    report_.note(in.where, "a bilerp ends at the edges of its square");
    return out;
}

}  // namespace ambilux::pbrt
