#include "formats/pbrt/solid_baking.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace ambilux::pbrt {

using namespace document;

namespace {

/// Texels of a shape; before, they are as fine as the texture asks for.
constexpr double kMostBaked = 1 << 21;
/// Of the length over which a texture changes: lines between centres are off by a hundredth of its finest octave.
constexpr double kTexel = 1.0 / 8;
/// Texels a side of a triangle's block.
constexpr double kMostSide = 1024;

Vec3d unit_or_z(Vec3d v) { return length(v) > 0 ? unit(v) : Vec3d{0, 0, 1}; }

/// The BSDF again, with what `replace` gives in the place of textures.
class Copier {
public:
    using Replace = std::function<const Object*(const Object& texture)>;
    Copier(Document& document, Replace replace) : document_(document), replace_(std::move(replace)) {}

    const Object* copy(const Object& object) {
        if (const Object*& known = copies_[&object]; known) return known;
        if (object.tag == "texture")
            if (const Object* other = replace_(object)) return copies_[&object] = other;
        Object& out = add_object(document_, object.tag, object.type, object.where);
        out.values = object.values;
        for (const Child& child : object.children) add_child(out, *copy(*child.object), child.name);
        return copies_[&object] = &out;
    }

private:
    Document& document_;
    Replace replace_;
    std::map<const Object*, const Object*> copies_;
};

double finest_detail(const SceneMaker& scene, const Object& bsdf) {
    double detail = std::numeric_limits<double>::infinity();
    for_all_below(bsdf, [&](const Object& o) {
        const MadeTexture* made = scene.textures.made(o);
        if (made && made->texture.kind == Texture::Kind::solid) detail = std::min(detail, made->texture.detail);
    });
    return detail;
}

/// A texture of an image whose texels `fill` sets.
const Object* add_texture(SceneMaker& scene, const Where& where, uint32_t width, uint32_t height,
                          const std::function<void(Texels&)>& fill) {
    take_texels(scene.document, where, uint64_t(width) * height, 16);
    const std::string name = where.text() + "#" + std::to_string(scene.document.images.size());
    fill(add_image(scene.document, name, width, height));
    return &add_bitmap(scene.document, where, name);
}

void set_texel(Texels& image, uint32_t x, uint32_t y, Rgb c) {
    float* texel = &image.floats[4 * (size_t(y) * image.width + x)];
    texel[0] = c.x, texel[1] = c.y, texel[2] = c.z;
}

void note_size(SceneMaker& scene, const Where& where, double size) {
    char text[32];
    snprintf(text, sizeof text, "%.0e", size);
    scene.report.note(where, std::string("solid textures are images of their shape, of texels about ") + text +
                                 " across, linear between their centres");
}

/// Corners of a triangle in the world, with coordinates.
struct Corners {
    Vec3d p[3], n;
    Vec2f uv[3];

    double longest() const { return std::max({length(p[1] - p[0]), length(p[2] - p[1]), length(p[0] - p[2])}); }
    SurfacePlace at(double x, double y) const {
        const auto mix = [&](float a, float b, float c) { return a + x * (double(b) - a) + y * (double(c) - a); };
        return {p[0] + (p[1] - p[0]) * x + (p[2] - p[0]) * y, n, mix(uv[0].x, uv[1].x, uv[2].x),
                mix(uv[0].y, uv[1].y, uv[2].y)};
    }
};

/// Blocks of texels, a square for each triangle, in rows of falling height.
struct Atlas {
    struct Block {
        uint32_t x = 0, y = 0, side = 2;
    };
    std::vector<Block> blocks;
    uint32_t width = 0, height = 0;
    double size = 0;  ///< of the largest texel

    Atlas(const std::vector<Corners>& triangles, double wanted) : blocks(triangles.size()) {
        std::vector<double> edges;
        for (const Corners& t : triangles) edges.push_back(t.longest());
        const double longest = *std::max_element(edges.begin(), edges.end());
        size = std::max(std::min(wanted, longest), longest / (kMostSide - 1));
        const auto side = [&](double edge) { return std::max(std::ceil(edge / size), 1.0) + 1; };
        for (const double least = 4.0 * double(blocks.size());; size *= 1.1) {
            double sum = 0;
            for (const double e : edges) sum += side(e) * side(e);
            if (sum <= std::max(kMostBaked, least)) break;
        }
        for (size_t i = 0; i < blocks.size(); ++i) blocks[i].side = uint32_t(side(edges[i]));
        pack();
    }

private:
    void pack() {
        double area = 0;
        for (const Block& b : blocks) area += double(b.side) * b.side, width = std::max(width, b.side);
        width = std::max(width, uint32_t(std::ceil(std::sqrt(area))));
        std::vector<uint32_t> order(blocks.size());
        std::iota(order.begin(), order.end(), 0);
        std::stable_sort(order.begin(), order.end(),
                         [&](uint32_t a, uint32_t b) { return blocks[a].side > blocks[b].side; });
        uint32_t x = 0, y = 0;
        for (const uint32_t i : order) {
            Block& b = blocks[i];
            if (x + b.side > width) x = 0, y = height;
            b.x = x, b.y = y;
            x += b.side;
            height = std::max(height, y + b.side);
        }
    }
};

/// Coordinates of the surface do not go on over the edges of triangles.
void check_tangents(SceneMaker& scene, const Where& where, const Object& bsdf) {
    bool turns = false;
    for_all_below(bsdf, [&](const Object& o) {
        const Value *u = o.find("alpha_u"), *v = o.find("alpha_v");
        turns |= o.type == "normalmap" || (u && v && u->number != v->number);
    });
    if (turns)
        scene.report.refuse(where, "solid textures on meshes with normal maps or two roughnesses are not supported",
                            "these turn from triangle to triangle");
}

}  // namespace

BakedMesh bake_solids(SceneMaker& scene, const Where& where, const Mesh& mesh, const Matrix& to_world,
                      const Object& bsdf) {
    check_tangents(scene, where, bsdf);
    FileBudget(where.file, scene.document.limits).bytes(mesh.faces.size(), sizeof(Corners) + 3 * sizeof(Vec3f));
    std::vector<Corners> triangles;
    for (const auto& face : mesh.faces) {
        Corners t;
        for (size_t k = 0; k < 3; ++k) {
            t.p[k] = transformed(to_world, in_double(mesh.positions[face[k]]));
            t.uv[k] = mesh.uvs[face[k]];
        }
        t.n = unit_or_z(cross(t.p[1] - t.p[0], t.p[2] - t.p[0]));
        triangles.push_back(t);
    }
    const Atlas atlas(triangles, kTexel * finest_detail(scene, bsdf));
    note_size(scene, where, atlas.size);
    Copier copier(scene.document, [&](const Object& texture) -> const Object* {
        const MadeTexture* made = scene.textures.made(texture);
        if (!made) return nullptr;
        return add_texture(scene, where, atlas.width, atlas.height, [&](Texels& image) {
            tbb::parallel_for(size_t(0), triangles.size(), [&](size_t i) {
                const Atlas::Block& b = atlas.blocks[i];
                const double cells = b.side - 1;
                for (uint32_t y = 0; y < b.side; ++y)
                    for (uint32_t x = 0; x < b.side && x + y <= b.side; ++x)  // the last ones lie behind the third edge
                        set_texel(image, b.x + x, b.y + y, made->at(triangles[i].at(x / cells, y / cells)));
            });
        });
    });
    BakedMesh out;
    out.bsdf = copier.copy(bsdf);
    out.mesh = with_own_corners(mesh);
    for (const Atlas::Block& b : atlas.blocks)
        for (uint32_t k = 0; k < 3; ++k) {
            const double x = b.x + 0.5 + (k == 1 ? b.side - 1 : 0), y = b.y + 0.5 + (k == 2 ? b.side - 1 : 0);
            out.mesh.uvs.push_back({float(x / atlas.width), float(y / atlas.height)});
        }
    return out;
}

const Object* bake_solids(SceneMaker& scene, const Where& where, Surface surface, const Matrix& to_world,
                          const Object& bsdf) {
    const double turn = 2 * M_PI;
    const double radius = std::max(length(column(to_world, 0)), length(column(to_world, 1)));
    const double along = surface == Surface::sphere ? M_PI * radius : length(column(to_world, 2));
    const double sizes[2] = {surface == Surface::disk ? radius : turn * radius,
                             surface == Surface::disk ? turn * radius : along};
    double size = std::max(kTexel * finest_detail(scene, bsdf), std::sqrt(sizes[0] * sizes[1] / kMostBaked));
    size = std::min(size, radius / 32);  // the normal changes too
    const auto count = [size](double extent) { return uint32_t(std::clamp(std::ceil(extent / size), 1.0, 65536.0)); };
    const uint32_t width = count(sizes[0]), height = count(sizes[1]);
    note_size(scene, where, size);
    // Where Mitsuba's shape has coordinates (u,v), and its normal there.
    const auto local = [&](double u, double v, Vec3d& p, Vec3d& n) {
        if (surface == Surface::sphere) {
            p = n = {std::sin(M_PI * v) * std::cos(turn * u), std::sin(M_PI * v) * std::sin(turn * u),
                     std::cos(M_PI * v)};
        } else if (surface == Surface::disk) {
            p = {u * std::cos(turn * v), u * std::sin(turn * v), 0}, n = {0, 0, 1};
        } else {
            n = {std::cos(turn * u), std::sin(turn * u), 0}, p = {n.x, n.y, v};
        }
    };
    const Matrix inverse = affine_inverse(to_world);
    const UvMap to_pbrt = uv_map(surface);
    const auto place = [&](double u, double v) -> SurfacePlace {
        Vec3d p, n;
        local(u, v, p, n);
        const auto& m = to_pbrt.m;
        // Normals go by the transposed inverse.
        const Vec3d world_n = {dot(column(inverse, 0), n), dot(column(inverse, 1), n), dot(column(inverse, 2), n)};
        return {transformed(to_world, p), unit_or_z(world_n), m[0][0] * u + m[0][1] * v + m[0][2],
                m[1][0] * u + m[1][1] * v + m[1][2]};
    };
    Copier copier(scene.document, [&](const Object& texture) -> const Object* {
        const MadeTexture* made = scene.textures.made(texture);
        if (!made) return nullptr;
        if (made->texture.kind != Texture::Kind::solid) return &texture;
        return add_texture(scene, where, width, height, [&](Texels& image) {
            tbb::parallel_for(0u, height, [&](uint32_t y) {
                for (uint32_t x = 0; x < width; ++x)
                    set_texel(image, x, y, made->at(place((x + 0.5) / width, (y + 0.5) / height)));
            });
        });
    });
    return copier.copy(bsdf);
}

}  // namespace ambilux::pbrt
