#include <cmath>

#include "formats/gzip.h"
#include "formats/pbrt/cut_quadrics.h"
#include "formats/pbrt/meshes.h"
#include "formats/pbrt/names.h"
#include "formats/pbrt/scene.h"
#include "formats/pbrt/solid_baking.h"

namespace ambilux::pbrt {

using namespace document;

namespace {

bool has_texture(const Object& object) {
    bool found = false;
    for_all_below(object, [&](const Object& o) { found |= o.tag == "texture"; });
    return found;
}

/// Area of the triangles in the world if all have the same, else 0: pbrt gives its power to each.
double triangle_area(const Mesh& mesh, const Matrix& m) {
    double first = 0;
    for (const auto& f : mesh.faces) {
        const auto corner = [&](int k) { return transformed(m, in_double(mesh.positions[f[size_t(k)]]), 0); };
        const double area = length(cross(corner(1) - corner(0), corner(2) - corner(0))) / 2;
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
    const QuadricShape q = read_quadric(in);
    Object& object = add_object(scene.document, "shape", in.type, in.where);
    if (in.type == "sphere") return {&object, scaling(q.radius, q.radius, q.radius), q.area};
    const double length = in.type == "disk" ? 1 : q.high - q.low;
    return {&object, translation(0, 0, q.low) * scaling(q.radius, q.radius, length), q.area};
}

Mesh own_mesh(SceneMaker& scene, const Parameters& in, double& exact_area) {
    if (surface_of(in.type) != Surface::mesh) {
        const QuadricShape q = read_quadric(in);
        exact_area = q.area;
        if (q.is_cut)
            scene.report.note(in.where,
                              "parts of spheres, disks and cylinders are triangles: 256 around, 128 from pole to pole");
        else if (is_stretched(surface_of(in.type), scene.state.ctm))
            note_stretched(scene, in.where);
        return mesh_of_quadric(in.type, q);
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
        const std::string path = resolve(scene.folder, in.filename(), in.where_of("filename"));
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
        for (const std::string& note : mesh.notes) scene.report.note({path, 0}, note);
        out.local = translation(mesh.origin[0], mesh.origin[1], mesh.origin[2]);
    } else {
        mesh = own_mesh(scene, in, exact_area);
    }
    check_mesh(in.where.text(), mesh);
    const Matrix placed = scene.state.ctm * out.local;
    if (projection)
        mesh = projected(mesh, placed, *projection);
    else if (mesh.uvs.empty() && textured)
        mesh = with_default_uvs(mesh);
    if (solid) {
        BakedMesh baked = bake_solids(scene, in.where, mesh, placed, **solid);
        mesh = std::move(baked.mesh);
        *solid = baked.bsdf;
    }
    out.area = is_file ? 0 : exact_area > 0 ? exact_area : triangle_area(mesh, scene.state.ctm);
    out.object = &add_object(scene.document, "shape", "mesh", in.where);
    const std::string name = in.where.text() + "#" + std::to_string(scene.document.meshes.size());
    mesh.notes.clear(), mesh.origin = {};  // said, and in `local`
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

/// What decides how a shape is made: with coordinates that textures need it becomes a mesh.
struct Look {
    Surface surface;
    bool hidden = false, solid = false;  ///< a light that no ray meets; solid textures
    const Object* bsdf = nullptr;
    std::shared_ptr<const Projection> projection;
};

Look look_of(SceneMaker& scene, const Parameters& in, Surface surface) {
    Look look{surface, shines_unseen(scene, in), false, nullptr, nullptr};
    const auto surface_bsdf = [&]() -> const Object* {
        if (look.hidden) return &add_object(scene.document, "bsdf", "null", in.where);
        return masked(scene, in, surface_material(scene, scene.state.material, look.surface), uv_map(look.surface));
    };
    look.bsdf = surface_bsdf();
    look.solid = scene.textures.has_solid(*look.bsdf);
    // Images that stand for solid textures have coordinates of their own.
    if (!look.solid || look.surface != Surface::mesh) look.projection = scene.textures.projection_of(*look.bsdf);
    if (scene.open_object && look.solid)
        scene.report.refuse(in.where, "solid textures inside of an object are not supported",
                            "they stand as where the object does");
    else if (scene.open_object && look.projection)
        scene.report.refuse(in.where, "texture mappings other than uv inside of an object are not supported",
                            "they stand as where the object does");
    if (look.projection && look.surface != Surface::mesh) look.surface = Surface::mesh, look.bsdf = surface_bsdf();
    if (look.solid) look.projection = nullptr;
    return look;
}

/// Nothing where the curve has no length.
Placed add_curve(SceneMaker& scene, const Parameters& in, Look& look) {
    const std::vector<Curve> curves = read_curve(scene, in);
    if (look.projection)
        scene.report.refuse(in.where, "texture mappings other than uv on curves are not supported", "uv is used");
    if (look.solid) {
        scene.report.refuse(in.where, "solid textures on curves are not supported", "the curve is grey");
        look.bsdf = surface_material(scene, nullptr, look.surface);
    }
    const bool textured = has_texture(*look.bsdf);
    if (textured)
        scene.report.note(in.where, "textures wrap around curves; in pbrt they run from edge to edge as seen");
    Placed placed;
    if (!curves.empty())
        placed.object =
            add_curves(scene, in, curves, look.bsdf, textured || in.find("alpha") || scene.state.area_light);
    return placed;
}

Placed add_surface(SceneMaker& scene, const Parameters& in, Look& look) {
    if (in.type == "curve" && in.text("type", "flat") != "ribbon") return add_curve(scene, in, look);
    if (look.surface != Surface::mesh) {
        const Placed placed = add_quadric(scene, in);
        if (look.solid)
            look.bsdf = bake_solids(scene, in.where, look.surface, scene.state.ctm * placed.local, *look.bsdf);
        return placed;
    }
    const bool shines = scene.state.area_light && scene.state.area_light->in.find("filename");
    if (shines && look.solid)
        scene.report.refuse(in.where, "a light with an image on a mesh with solid textures is not supported",
                            "the image lies wrong");
    return add_mesh(scene, in, shines || has_texture(*look.bsdf), look.projection.get(),
                    look.solid ? &look.bsdf : nullptr);
}

}  // namespace

bool is_stretched(Surface surface, const Matrix& m) {
    return (surface == Surface::sphere || surface == Surface::cylinder) && !keeps_round(m, surface == Surface::sphere);
}

void note_stretched(SceneMaker& scene, const Where& where) {
    scene.report.note(where, "stretched spheres and cylinders are triangles: 256 around, 128 from pole to pole");
}

void add_shape(SceneMaker& scene, const Parameters& in, bool as_mesh) {
    const std::string& type = in.type;
    const bool round = surface_of(type) != Surface::mesh, quadric = round && !as_mesh && !read_quadric(in).is_cut &&
                                                                    !is_stretched(surface_of(type), scene.state.ctm);
    if (!round && type != "trianglemesh" && type != "plymesh" && type != "bilinearmesh" && type != "loopsubdiv" &&
        type != "curve")
        return scene.report.refuse(in.where, not_supported("shape", type), "it is left out");
    check_shapes(scene.document.limits, ++scene.shape_count, in.where);
    Look look = look_of(scene, in, quadric ? surface_of(type) : Surface::mesh);
    const Placed placed = add_surface(scene, in, look);
    if (!placed.object) return in.finish(scene.report);
    Object& shape = *placed.object;
    set_transform(shape, "to_world", scene.state.ctm * placed.local);
    if (scene.state.reverse_orientation) set_boolean(shape, "flip_normals", true);
    add_child(shape, *look.bsdf);
    if (scene.state.area_light && scene.open_object)
        scene.report.note(in.where, "shapes of an object do not emit, as in pbrt");
    else if (scene.state.area_light)
        add_child(shape, area_emitter(scene, *scene.state.area_light, uv_map(look.surface), placed.area, look.hidden,
                                      look.hidden ? Texture{} : scene.textures.number(in, "alpha", 1)));
    in.finish(scene.report);
    if (scene.open_object && (look.surface == Surface::sphere || look.surface == Surface::cylinder))
        scene.round_shapes.push_back({{in, scene.state, scene.open_object}, look.surface, &shape});
    add_child(scene.open_object ? *scene.open_object : *scene.document.scene, shape);
    if (scene.state.area_light && !scene.open_object && scene.state.area_light->in.boolean("twosided", false))
        add_back(scene, in, shape, *look.bsdf);
}

}  // namespace ambilux::pbrt
