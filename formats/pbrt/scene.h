// What the directives of a pbrt file build up. One file per kind of directive; this is what they share.
#pragma once

#include <optional>

#include "formats/meshes/curves.h"
#include "formats/pbrt/textures.h"

namespace ambilux::pbrt {

using document::Document;
using document::Matrix;

/// Parameters and the colour space that held where they stood.
struct Described {
    Parameters in;
    ColorSpace space = ColorSpace::srgb;
};
using Shared = std::shared_ptr<const Described>;

/// What AttributeBegin keeps and AttributeEnd brings back.
struct State {
    Matrix ctm;
    bool reverse_orientation = false;
    ColorSpace space = ColorSpace::srgb;
    Shared material;                                           ///< null: diffuse
    Shared area_light;                                         ///< null: none
    std::map<std::string, std::vector<Parameter>> attributes;  ///< of directive Attribute, by what they are for
};

/// What shapes can be put on: where their coordinates differ from those of Mitsuba's shape.
enum class Surface { mesh, sphere, disk, cylinder };

/// Curves that make one mesh.
struct CurveMesh {
    std::string name;  ///< of the mesh
    Where where;
    std::vector<Curve> curves;
    const Object* bsdf;  ///< null: no others join
    Object* group;
    bool reversed;
    Matrix to_world;
};

/// A shape on a material that the file defines further down.
struct LateShape {
    Parameters in;
    State state;
    Object* open_object;
};

/// A sphere or cylinder of an object, from which an instance may make a mesh.
struct RoundShape {
    LateShape shape;
    Surface surface;
    const Object* object;
};

/// Of an object of the file, whose shapes need not be known yet.
struct Instance {
    Object* object;
    const Object* group;
    Matrix ctm;
};

struct SceneMaker {
    SceneMaker(Document& d, Report& r, std::string f)
        : document(d), report(r), folder(std::move(f)), textures({folder, d, r}, d, r) {}

    Document& document;
    Report& report;
    std::string folder;  ///< of the main file
    Textures textures;
    State state;
    std::map<std::string, Shared> named_materials;
    std::map<std::string, Object*> objects;  ///< shape groups of ObjectBegin
    Object* open_object = nullptr;
    Object* environment = nullptr;  ///< emitter of the infinite lights so far
    double exposure = 1;            ///< imaging ratio of the film
    uint64_t shape_count = 0;
    std::vector<CurveMesh> curves;
    std::vector<LateShape> late_shapes;
    std::vector<RoundShape> round_shapes;
    std::vector<Instance> instances;

    /// BSDFs of materials; keeps the materials, so that no address comes twice.
    std::map<std::pair<Shared, Surface>, const Object*> materials;

    const SpectrumReader& spectra() const { return textures.spectra(); }
};

/// Camera, film, filter, sampler and integrator, which stand before WorldBegin.
struct Options {
    std::optional<Parameters> camera, film, filter, sampler, integrator;
    Matrix camera_to_world;
};
void add_options(SceneMaker& scene, const Options& options);

/// `as_mesh`: what else would be a sphere, disk or cylinder too.
void add_shape(SceneMaker& scene, const Parameters& in, bool as_mesh = false);
/// At once, or by finish_shapes if the shape's material is still unknown.
void add_shape_when_known(SceneMaker& scene, Parameters in);
void finish_shapes(SceneMaker& scene);
void add_instance(SceneMaker& scene, Object& group, const Where& where);
/// Once all shapes are known.
void finish_instances(SceneMaker& scene);
/// True of a sphere or cylinder that the transform stretches or shears into what no quadric here is (make_quadric()).
bool is_stretched(Surface surface, const Matrix& m);
void note_stretched(SceneMaker& scene, const Where& where);
/// Directive of what stands for a material that is not defined yet; its type is the name.
inline constexpr char kNamedMaterial[] = "NamedMaterial";
Shared named_material(const SceneMaker& scene, const std::string& name, const Where& where);
/// Shape "curve" as cubic B-splines.
std::vector<Curve> read_curve(SceneMaker& scene, const Parameters& in);
/// Shape "curve" of type "ribbon".
Mesh ribbon_mesh(SceneMaker& scene, const Parameters& in);
/// A new mesh for curves, or null if they join the one before. `alone`: nothing may join.
Object* add_curves(SceneMaker& scene, const Parameters& in, const std::vector<Curve>& curves, const Object* bsdf,
                   bool alone);
/// Makes the meshes, once all curves are known: the more there are, the fewer sides they have.
void finish_curves(SceneMaker& scene);
void add_light(SceneMaker& scene, const Described& light);
/// The emitter of a shape. `area`: of the shape as pbrt measures it for the parameter power; 0: not known. `hidden`: no
/// ray meets it.
const Object& area_emitter(SceneMaker& scene, const Described& light, const UvMap& uv, double area, bool hidden,
                           const Texture& alpha);

/// BSDF of a material, two-sided unless it transmits light; null material: diffuse.
const Object* surface_material(SceneMaker& scene, const Shared& material, Surface surface);
UvMap uv_map(Surface surface);

}  // namespace ambilux::pbrt
