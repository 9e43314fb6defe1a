#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "formats/gzip.h"
#include "formats/meshes/loop_subdivision.h"
#include "formats/pbrt/cut_quadrics.h"
#include "formats/pbrt/scene.h"
#include "formats/pbrt/solid_baking.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

/// Cells a side of a bilinear patch that is no parallelogram.
constexpr uint32_t kPatchCells = 8;

std::vector<Vec3f> triples(const Parameters& in, const char* name, size_t vertices = 0) {
    const std::vector<double>& numbers = in.numbers(name, 3);
    if (vertices && !numbers.empty() && numbers.size() != 3 * vertices)
        fail(in.where_of(name), std::string("'") + name + "' is given for " + std::to_string(numbers.size() / 3) +
                                    " of " + std::to_string(vertices) + " vertices");
    std::vector<Vec3f> out(numbers.size() / 3);
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = {float(numbers[3 * i]), float(numbers[3 * i + 1]), float(numbers[3 * i + 2])};
    return out;
}

std::vector<uint32_t> indices_of(const Parameters& in, size_t corners, size_t vertices) {
    std::vector<uint32_t> out;
    for (double i : in.numbers("indices", corners)) {
        if (!(i >= 0 && i < double(vertices)))
            fail(in.where_of("indices"),
                 "index " + std::to_string(int64_t(i)) + " of " + std::to_string(vertices) + " vertices");
        out.push_back(uint32_t(i));
    }
    if (out.empty() && vertices == corners)
        for (uint32_t i = 0; i < corners; ++i) out.push_back(i);
    if (out.empty()) fail(in.where, in.type + " has no indices");
    return out;
}

Mesh vertices_of(const Parameters& in) {
    Mesh mesh;
    mesh.positions = triples(in, "P");
    if (mesh.positions.empty()) fail(in.where, in.type + " has no vertices 'P'");
    mesh.normals = triples(in, "N", mesh.positions.size());
    const char* name = in.find("uv") ? "uv" : "st";
    const std::vector<double>& uvs = in.numbers(name, 2);
    if (!uvs.empty() && uvs.size() != 2 * mesh.positions.size())
        fail(in.where_of(name), "texture coordinates are given for " + std::to_string(uvs.size() / 2) + " of " +
                                    std::to_string(mesh.positions.size()) + " vertices");
    for (size_t i = 0; i < uvs.size(); i += 2) mesh.uvs.push_back({float(uvs[i]), float(uvs[i + 1])});
    return mesh;
}

Mesh triangle_mesh(SceneMaker& scene, const Parameters& in) {
    Mesh mesh = vertices_of(in);
    if (in.find("S"))
        scene.report.note(in.where_of("S"), "tangents S are left out: rough surfaces turn with texture coordinates");
    in.ignore({"faceIndices"});  // of ptex
    const std::vector<uint32_t> indices = indices_of(in, 3, mesh.positions.size());
    for (size_t i = 0; i < indices.size(); i += 3) mesh.faces.push_back({indices[i], indices[i + 1], indices[i + 2]});
    return mesh;
}

/// Every triangle gets vertices of its own with pbrt's default coordinates.
Mesh with_default_uvs(const Mesh& mesh) {
    Mesh out;
    constexpr Vec2f uvs[3] = {{0, 0}, {1, 0}, {1, 1}};
    for (const auto& face : mesh.faces) {
        const uint32_t first = uint32_t(out.positions.size());
        for (int i = 0; i < 3; ++i) {
            out.positions.push_back(mesh.positions[face[size_t(i)]]);
            if (!mesh.normals.empty()) out.normals.push_back(mesh.normals[face[size_t(i)]]);
            out.uvs.push_back(uvs[i]);
        }
        out.faces.push_back({first, first + 1, first + 2});
    }
    return out;
}

Mesh bilinear_mesh(SceneMaker& scene, const Parameters& in) {
    const Mesh corners = vertices_of(in);
    in.ignore({"emissionfilename"});  // how pbrt samples the light of an image, which the light has itself
    const std::vector<uint32_t> indices = indices_of(in, 4, corners.positions.size());
    FileBudget budget(in.where.file, scene.document.limits);
    Mesh out;
    for (size_t first = 0; first < indices.size(); first += 4) {
        const uint32_t* q = indices.data() + first;  // at (u,v) = 00, 10, 01, 11
        const auto& p = corners.positions;
        const Vec3f twist = p[q[0]] + p[q[3]] - p[q[1]] - p[q[2]];
        const bool flat = length(twist) <= 1e-6f * length(p[q[3]] - p[q[0]]);
        const uint32_t n = flat && corners.normals.empty() ? 1 : kPatchCells;
        if (!flat)
            scene.report.note(in.where, "bilinear patches that are no parallelograms are 8x8 cells of two triangles");
        const uint32_t base = uint32_t(out.positions.size());
        budget.bytes(base + uint64_t(n + 1) * (n + 1), sizeof(Vec3f));
        for (uint32_t j = 0; j <= n; ++j)
            for (uint32_t i = 0; i <= n; ++i) {
                const float u = float(i) / float(n), v = float(j) / float(n);
                const float w[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
                Vec3f position{}, normal{};
                Vec2f uv{};
                for (int k = 0; k < 4; ++k) {
                    position += p[q[k]] * w[k];
                    if (!corners.normals.empty()) normal += corners.normals[q[k]] * w[k];
                    if (!corners.uvs.empty()) uv.x += corners.uvs[q[k]].x * w[k], uv.y += corners.uvs[q[k]].y * w[k];
                }
                out.positions.push_back(position);
                if (!corners.normals.empty()) out.normals.push_back(normal);
                out.uvs.push_back(corners.uvs.empty() ? Vec2f{u, v} : uv);
            }
        for (uint32_t j = 0; j < n; ++j)
            for (uint32_t i = 0; i < n; ++i) {
                const uint32_t a = base + j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
                out.faces.push_back({a, b, d});
                out.faces.push_back({a, d, c});
            }
    }
    return out;
}

Mesh loop_subdivision(SceneMaker& scene, const Parameters& in) {
    Mesh mesh = triangle_mesh(scene, in);
    const int64_t levels = in.integer("levels", 3);
    if (levels < 0 || levels > 12) fail(in.where_of("levels"), "levels must lie between 0 and 12");
    scene.report.note(in.where,
                      "a loopsubdiv is refined as often as it says, and its vertices moved to the limit surface");
    return subdivide_loop(in.where.file + ":" + std::to_string(in.where.line), mesh, int(levels),
                          scene.document.limits);
}

/// Whether a PLY file gives texture coordinates, as its header tells; what cannot be told counts as yes.
bool has_uvs(const std::string& path) {
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored)) return true;  // read_input says what is wrong with it
    std::ifstream file(path, std::ios::binary);
    std::string head(1 << 16, '\0');
    file.read(head.data(), std::streamsize(head.size()));
    head.resize(size_t(std::max<std::streamsize>(file.gcount(), 0)));
    if (!head.starts_with("ply")) return false;  // packed
    const size_t end = head.find("end_header");
    if (end == std::string::npos) return true;
    for (const char* name : {" u", " s", " texture_u"})
        for (const char* line : {"\n", "\r"})
            if (head.find(name + std::string(line)) < end) return true;
    return false;
}

/// `seen`: what was looked into; objects are shared, and a mix of mixes may hold one 2^n times.
bool has_texture(const Object& object) {
    bool found = false;
    for_all_below(object, [&](const Object& o) { found |= o.tag == "texture"; });
    return found;
}

/// Area of the triangles in the world if all have the same, else 0: pbrt gives its power to each.
double triangle_area(const Mesh& mesh, const Matrix& m) {
    const auto row = [&m](int i, Vec3f p) {
        return m.m[i][0] * double(p.x) + m.m[i][1] * double(p.y) + m.m[i][2] * double(p.z);
    };
    double first = 0;
    for (const auto& f : mesh.faces) {
        const Vec3f &a = mesh.positions[f[0]], &b = mesh.positions[f[1]], &c = mesh.positions[f[2]];
        const auto edge = [&](Vec3f p) {
            return Vec3d{row(0, p) - row(0, a), row(1, p) - row(1, a), row(2, p) - row(2, a)};
        };
        const double area = length(cross(edge(b), edge(c))) / 2;
        if (first == 0) first = area;
        if (std::fabs(area - first) > 1e-4 * first) return 0;
    }
    return first;
}

struct Placed {
    Object* object = nullptr;
    Matrix local;
    double area = 0;
};

Surface surface_of(const std::string& type) {
    return type == "sphere"     ? Surface::sphere
           : type == "disk"     ? Surface::disk
           : type == "cylinder" ? Surface::cylinder
                                : Surface::mesh;
}

Placed add_quadric(SceneMaker& scene, const Parameters& in) {
    Placed out;
    out.object = &add_object(scene.document, "shape", in.type, in.where);
    const double radius = in.number("radius", 1);
    if (!(radius > 0)) fail(in.where_of("radius"), "radius must be positive");
    if (in.type == "sphere") {
        out.local = scaling(radius, radius, radius);
        out.area = 4 * M_PI * radius * radius;
    } else if (in.type == "disk") {
        out.local = translation(0, 0, in.number("height", 0)) * scaling(radius, radius, 1);
        out.area = M_PI * radius * radius;
    } else {
        const double low = in.number("zmin", -1), high = in.number("zmax", 1);
        const double bottom = std::min(low, high), top = std::max(low, high);
        if (!(top > bottom)) fail(in.where, "a cylinder needs a length: zmin equals zmax");
        out.local = translation(0, 0, bottom) * scaling(radius, radius, top - bottom);
        out.area = 2 * M_PI * radius * (top - bottom);
    }
    return out;
}

/// A sphere or cylinder that its transform stretches or shears into what no quadric here is (make_quadric()).
bool is_stretched(const SceneMaker& scene, const Parameters& in) {
    const Surface surface = surface_of(in.type);
    if (surface != Surface::sphere && surface != Surface::cylinder) return false;
    constexpr double kTolerance = 1e-3;
    const Matrix& m = scene.state.ctm;
    const auto axis = [&m](int i) { return length(Vec3d{m.m[0][i], m.m[1][i], m.m[2][i]}); };
    const double lx = axis(0), ly = axis(1), lz = axis(2);
    const double radius = surface == Surface::sphere ? (lx + ly + lz) / 3 : (lx + ly) / 2;
    const auto differs = [&](double l) { return !(std::fabs(l - radius) < kTolerance * radius); };
    return !is_orthogonal(m, kTolerance) || differs(lx) || differs(ly) || (surface == Surface::sphere && differs(lz));
}

Mesh own_mesh(SceneMaker& scene, const Parameters& in, double& exact_area) {
    if (surface_of(in.type) != Surface::mesh) {
        if (is_cut(in))
            scene.report.note(in.where,
                              "parts of spheres, disks and cylinders are triangles: 256 around, 128 from pole to pole");
        else if (is_stretched(scene, in))
            scene.report.note(in.where,
                              "stretched spheres and cylinders are triangles: 256 around, 128 from pole to pole");
        return cut_quadric(in, exact_area);
    }
    if (in.type == "trianglemesh") return triangle_mesh(scene, in);
    if (in.type == "bilinearmesh") return bilinear_mesh(scene, in);
    if (in.type == "curve") return ribbon_mesh(scene, in);
    return loop_subdivision(scene, in);
}

/// `textured`: something on it needs coordinates, which `projection`, if any, gives. `solid`: a BSDF with solid
/// textures, which is replaced by one with images; else null.
Placed add_mesh(SceneMaker& scene, const Parameters& in, bool textured, const Projection* projection,
                const Object** solid) {
    Placed out;
    double exact_area = 0;
    Mesh mesh;
    const bool is_file = in.type == "plymesh";
    if (is_file) {
        const std::string path = resolve(scene.folder, in.text("filename", ""), in.where_of("filename"));
        if (in.find("displacement"))
            scene.report.refuse(in.where_of("displacement"), "displacement of meshes is not supported",
                                "it is left out");
        in.ignore({"displacement", "edgelength", "displacement.edgelength"});
        if (!textured || (!projection && !solid && has_uvs(path))) {
            out.object = &add_object(scene.document, "shape", "ply", in.where);
            set_text(*out.object, "filename", path);
            return out;
        }
        const Limits& limits = scene.document.limits;
        const std::string bytes = gunzip_if_packed(path, read_input(path, limits), limits);
        scene.document.file_digests.push_back({path, sha256(bytes)});
        mesh = read_ply(path, bytes, false, limits);
    } else {
        mesh = own_mesh(scene, in, exact_area);
    }
    check_mesh(in.where.file + ":" + std::to_string(in.where.line), mesh);
    if (projection)
        mesh = projected(mesh, scene.state.ctm, *projection);
    else if (mesh.uvs.empty() && textured)
        mesh = with_default_uvs(mesh);
    if (solid) {
        BakedMesh baked = bake_solids(scene, in.where, mesh, scene.state.ctm, **solid);
        mesh = std::move(baked.mesh);
        *solid = baked.bsdf;
    }
    out.area = is_file ? 0 : exact_area > 0 ? exact_area : triangle_area(mesh, scene.state.ctm);
    out.object = &add_object(scene.document, "shape", "mesh", in.where);
    const std::string name =
        in.where.file + ":" + std::to_string(in.where.line) + "#" + std::to_string(scene.document.meshes.size());
    scene.document.meshes[name] = std::move(mesh);
    set_text(*out.object, "name", name);
    return out;
}

/// The BSDF with the shape's `alpha` around it.
const Object* masked(SceneMaker& scene, const Parameters& in, const Object* bsdf, const UvMap& uv) {
    const Parameter* alpha = in.find("alpha");
    if (!alpha) return bsdf;
    const Texture opacity = scene.textures.number(in, "alpha", 1);
    if (opacity.is_constant() && !(opacity.color.x < 1)) return bsdf;
    Object& mask = add_object(scene.document, "bsdf", "mask", alpha->where);
    scene.textures.set_number(mask, "opacity", opacity, uv);
    add_child(mask, *bsdf);
    return &mask;
}

/// A light of alpha 0: it lights what there is, and no ray meets it.
bool shines_unseen(SceneMaker& scene, const Parameters& in) {
    if (!scene.state.area_light || scene.open_object || !in.find("alpha")) return false;
    const Texture opacity = scene.textures.number(in, "alpha", 1);
    return opacity.is_constant() && opacity.color.x <= 0;
}

/// A light of two sides is two shapes.
void add_back(SceneMaker& scene, const Parameters& in, const Object& shape, const Object& bsdf) {
    // A pane without a boundary in front of another one is one; whatever else lets light through is not.
    if (bsdf.type != "twosided" && bsdf.type != "null") {
        scene.report.refuse(in.where, "a light of two sides whose surface lets light through is not supported",
                            "it has one");
        return;
    }
    scene.report.note(in.where, "lights of two sides are two surfaces, a hundred-thousandth of their extent apart");
    add_child(*scene.document.scene, add_light_back(scene.document, shape));
}

}  // namespace

void add_shape(SceneMaker& scene, const Parameters& in) {
    const std::string& type = in.type;
    const bool round = surface_of(type) != Surface::mesh, quadric = round && !is_cut(in) && !is_stretched(scene, in);
    if (!round && type != "trianglemesh" && type != "plymesh" && type != "bilinearmesh" && type != "loopsubdiv" &&
        type != "curve")
        return scene.report.refuse(in.where, "shape '" + type + "' is not supported", "it is left out");
    if (++scene.shape_count > scene.document.limits.shapes)
        fail(in.where,
             "the scene has more shapes than --limits shapes=" + std::to_string(scene.document.limits.shapes));
    Surface surface = quadric ? surface_of(type) : Surface::mesh;
    const bool hidden = shines_unseen(scene, in);
    const auto surface_bsdf = [&]() -> const Object* {
        if (hidden) return &add_object(scene.document, "bsdf", "null", in.where);
        return masked(scene, in, surface_material(scene, scene.state.material, surface), uv_map(surface));
    };
    const Object* bsdf = surface_bsdf();
    const bool solid = scene.textures.has_solid(*bsdf);
    // Images that stand for solid textures have coordinates of their own.
    std::shared_ptr<const Projection> projection =
        solid && surface == Surface::mesh ? nullptr : scene.textures.projection_of(*bsdf);
    if (solid) {
        if (scene.open_object)
            scene.report.refuse(in.where, "solid textures inside of an object are not supported",
                                "they stand as where the object does");
        if (projection) projection = nullptr, surface = Surface::mesh, bsdf = surface_bsdf();
    }
    if (projection) {
        if (scene.open_object)
            scene.report.refuse(in.where, "texture mappings other than uv inside of an object are not supported",
                                "they stand as where the object does");
        if (surface != Surface::mesh) surface = Surface::mesh, bsdf = surface_bsdf();
    }
    Placed placed;
    if (type == "curve" && in.text("type", "flat") != "ribbon") {
        const std::vector<Curve> curves = read_curve(scene, in);
        if (projection)
            scene.report.refuse(in.where, "texture mappings other than uv on curves are not supported", "uv is used");
        if (solid) {
            scene.report.refuse(in.where, "solid textures on curves are not supported", "the curve is grey");
            bsdf = surface_material(scene, nullptr, surface);
        }
        const bool textured = has_texture(*bsdf);
        if (textured)
            scene.report.note(in.where, "textures on curves go round them, not from edge to edge as they are seen");
        if (!curves.empty())
            placed.object = add_curves(scene, in, curves, bsdf, textured || in.find("alpha") || scene.state.area_light);
        if (!placed.object) return in.finish(scene.report);
    } else if (surface != Surface::mesh) {
        placed = add_quadric(scene, in);
        if (solid) bsdf = bake_solids(scene, in.where, surface, scene.state.ctm * placed.local, *bsdf);
    } else {
        const bool shines = scene.state.area_light && scene.state.area_light->in.find("filename");
        if (shines && solid)
            scene.report.refuse(in.where, "a light with an image on a mesh with solid textures is not supported",
                                "the image lies wrong");
        placed = add_mesh(scene, in, shines || has_texture(*bsdf), projection.get(), solid ? &bsdf : nullptr);
    }
    Object& shape = *placed.object;
    const UvMap uv = uv_map(surface);
    set_transform(shape, "to_world", scene.state.ctm * placed.local);
    if (scene.state.reverse_orientation) set_boolean(shape, "flip_normals", true);
    add_child(shape, *bsdf);
    if (scene.state.area_light && scene.open_object)
        scene.report.note(in.where, "shapes of an object do not shine, as in pbrt");
    else if (scene.state.area_light)
        add_child(shape, area_emitter(scene, *scene.state.area_light, uv, placed.area, hidden,
                                      hidden ? Texture{} : scene.textures.number(in, "alpha", 1)));
    in.finish(scene.report);
    add_child(scene.open_object ? *scene.open_object : *scene.document.scene, shape);
    if (scene.state.area_light && !scene.open_object && scene.state.area_light->in.boolean("twosided", false))
        add_back(scene, in, shape, *bsdf);
}

}  // namespace ambilux::pbrt
