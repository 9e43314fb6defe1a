#include <algorithm>
#include <cmath>
#include <utility>

#include "core/parallel.h"
#include "formats/document/builder.h"
#include "formats/document/plugins.h"
#include "formats/document/shape_jobs.h"
#include "formats/file_budget.h"
#include "formats/meshes/curves.h"
#include "formats/meshes/height_field.h"
#include "formats/meshes/mesh.h"
#include "formats/meshes/sdf_grid.h"

namespace ambilux::document {

namespace {

struct ShapeBuilder {
    Builder& builder;
    std::vector<MeshSource> sources;
    std::map<std::string, int> source_by_key;
    std::vector<Job> jobs;
    std::vector<GroupJobs> groups;
    std::map<const Object*, int> group_of;
    /// The shapes of the document in the order in which they are met, and what KeptGeometry::keys has of them.
    std::vector<std::pair<uint32_t, uint32_t>> materials_and_emitters;
    std::vector<std::string> keys;
    bool keys_tell_all = true;

    /// A mesh of the document.
    int add_given(Reader& in, const std::string& name) {
        MeshSource source;
        source.type = in.object().type;
        source.given = builder.document.mesh(name);
        if (!source.given) in.fail("the document has no mesh '" + name + "'");
        return add_source(std::move(source), "mesh " + name);
    }
    int add_source(MeshSource source, const std::string& key) {
        const auto [it, added] = source_by_key.try_emplace(key, int(sources.size()));
        source.key = key;
        if (added) sources.push_back(std::move(source));
        return it->second;
    }
    void add_job(Job job, bool in_group);
    bool take_over();

    void add_shape(const Object& object, const Matrix& outer, bool in_group);
    bool add_shapes_inside(Reader& in, const Matrix& outer, bool in_group);
    void read_placement(Reader& in, const Matrix& outer, Job& job);
    void add_instance(const Object& object, const Matrix& outer);
    void read_geometry(Reader& in, Job& job);
    void read_mesh_file(Reader& in, Job& job);
    void read_tessellated(Reader& in, Job& job, const Matrix& outer);
    uint32_t add_emitter(const Object& object);
    uint32_t material_of_attributes(Job& job, Reader& in, const Object& bsdf, const std::set<std::string>& names);
};

bool is_quadric(const std::string& type) { return type == "sphere" || type == "disk" || type == "cylinder"; }
/// Made of triangles when they are read, because they are no primitives of ours.
bool is_tessellated(const std::string& type) {
    return type == "sdfgrid" || type == "linearcurve" || type == "bsplinecurve" || type == "heightfield";
}
bool is_mesh_file(const std::string& type) { return type == "obj" || type == "ply" || type == "serialized"; }

/// Of an object that is made of others. False if it is none.
bool ShapeBuilder::add_shapes_inside(Reader& in, const Matrix& outer, bool in_group) {
    const std::string& type = in.object().type;
    if (type == "shapegroup") {
        if (in_group) in.fail("a shapegroup inside of a shapegroup is not supported");
        return true;  // shown by its instances
    }
    if (type == "instance") {
        if (in_group) in.fail("an instance inside of a shapegroup is not supported");
        add_instance(in.object(), outer);
        return true;
    }
    if (type != "merge") return false;
    // One mesh of those inside, which looks the same.
    while (const Object* shape = in.take("shape")) add_shape(*shape, outer, in_group);
    in.finish();
    return true;
}

/// Where the shape stands, and which of its sides is the outside.
void ShapeBuilder::read_placement(Reader& in, const Matrix& outer, Job& job) {
    const Object& object = in.object();
    job.to_world = outer * in.transform("to_world");
    if (!(std::fabs(determinant(job.to_world)) > 0))
        in.fail(in.where("to_world"), "the transform of the shape is singular");
    job.flip = in.boolean("flip_normals", false);
    job.light_back = builder.document.light_backs.contains(&object);
    job.reverse = determinant(job.to_world) < 0;
    if (builder.document.mirrors_turn_in && object.version >= 2 && (is_mesh_file(job.type) || job.type == "sphere")) {
        // In Mitsuba 3 a mirrored mesh keeps the order of its corners, whose outside so turns in, and so does that of a
        // sphere. An instance keeps it.
        const bool mirrored = determinant(in.transform("to_world")) < 0;
        job.reverse = job.reverse != mirrored;
        if (job.type == "sphere") job.flip = job.flip != mirrored;
    }
}

void ShapeBuilder::add_shape(const Object& object, const Matrix& outer, bool in_group) {
    Reader in(builder, object);
    if (add_shapes_inside(in, outer, in_group)) return;
    const std::string& type = object.type;
    const bool given = type == "mesh" && builder.document.has_meshes();
    if (!is_one_of(shape_plugins(), type) && !given) {
        builder.refuse(object.where, "shape type '" + type + "' is not supported" + what_is_meant("shape", type),
                       "the shape is left out");
        return;
    }
    Job job;
    job.where = object.where;
    job.type = type;
    read_placement(in, outer, job);
    const Object* bsdf = in.take("bsdf");
    const std::set<std::string> attributes = bsdf ? mesh_attributes_of(*bsdf) : std::set<std::string>{};
    if (!attributes.empty() && type != "ply" && type != "obj" && type != "mesh")
        in.fail("mesh attributes are read from ply and obj files only");
    if (is_tessellated(type))
        read_tessellated(in, job, outer);
    else
        read_geometry(in, job);
    const Object* emitter = in.take("emitter");
    if (emitter && in_group)
        builder.refuse(emitter->where, "an emitter inside of a shapegroup is not supported", "the shape does not emit");
    else if (emitter)
        job.emitter = add_emitter(*emitter);
    if (!attributes.empty())
        job.material = material_of_attributes(job, in, *bsdf, attributes);
    else
        job.material = shape_material(builder, bsdf, emitter, job.where);
    in.leave({{"silhouette_sampling_weight"}}, "images are not differentiated");
    in.leave({{"shutter_open", "0"}, {"shutter_close", "0"}}, "nothing moves");
    if (type == "ply" && object.version < 2) in.ignore({"srgb"});  // of colours that nothing uses
    in.finish();
    add_job(std::move(job), in_group);
}

/// The bytes of a value that has no others.
template <class T>
void append_bytes(std::string& text, const T& value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void ShapeBuilder::add_job(Job job, bool in_group) {
    check_shapes(builder.options.limits, jobs.size() + 1, job.where);
    std::string key = job.type + '|';
    if (job.source >= 0) key += sources[size_t(job.source)].key;
    for (const auto& row : job.to_world.m)
        for (const double m : row) append_bytes(key, m);
    append_bytes(key, job.smooth_angle);
    append_bytes(key, job.group);
    for (const bool flag : {in_group, job.flip, job.face_normals, job.reverse, job.light_back}) key += flag ? '1' : '0';
    job.origin = uint32_t(keys.size());
    keys.push_back(std::move(key));
    materials_and_emitters.emplace_back(job.material, job.emitter);
    jobs.push_back(std::move(job));
}

/// Reads the mesh now, and gives the shape a copy of it that its textures are made for.
uint32_t ShapeBuilder::material_of_attributes(Job& job, Reader& in, const Object& bsdf,
                                              const std::set<std::string>& names) {
    MeshSource source = sources[size_t(job.source)];
    const Mesh mesh = source.given ? *source.given : read_with_attributes(builder, in, source, names);
    source.given = nullptr;
    std::map<std::string, int32_t> textures;
    source.mesh = with_attribute_atlas(builder, source.path.empty() ? job.where.file : source.path, mesh, textures);
    source.path.clear();
    job.source = add_source(std::move(source), "attributes " + std::to_string(jobs.size()));
    keys_tell_all = false;
    builder.attribute_textures = &textures;
    const uint32_t material = build_own_material(builder, bsdf);
    builder.attribute_textures = nullptr;
    return material;
}

void ShapeBuilder::read_geometry(Reader& in, Job& job) {
    if (is_mesh_file(job.type)) {
        read_mesh_file(in, job);
    } else if (is_quadric(job.type)) {
        job.to_world = job.to_world * local_form(in, job.type);
    } else if (job.type == "mesh") {
        const std::string name = in.text("name", "");
        job.source = add_given(in, name);
    } else {
        MeshSource source;
        source.type = job.type;
        source.mesh = job.type == "rectangle" ? make_rectangle() : make_cube();
        job.source = add_source(std::move(source), job.type);
        job.face_normals = true;
    }
}

void ShapeBuilder::read_mesh_file(Reader& in, Job& job) {
    job.face_normals = in.boolean("face_normals", false);
    job.smooth_angle = in.number("max_smooth_angle", -1);
    if (in.has("max_smooth_angle") && !(job.smooth_angle >= 0 && job.smooth_angle <= 180))
        in.fail(in.where("max_smooth_angle"), "max_smooth_angle must lie between 0 and 180 degrees");
    if (builder.document.has_meshes() && in.has("mesh")) {
        job.source = add_given(in, in.text("mesh", ""));
        return;
    }
    MeshSource source;
    const std::string name = in.text("filename", "");
    if (name.empty()) in.fail_without("filename", job.type + " shape has no filename");
    source.path = builder.file(name, in.where("filename"));
    source.type = job.type;
    source.flip_v = in.boolean("flip_tex_coords", job.type == "obj");
    if (job.type == "serialized")
        source.shape_index = int(std::clamp<int64_t>(in.integer("shape_index", 0), -1, 1 << 30));
    if (job.type == "obj") read_obj_parts(builder, in, source);
    const std::string key = source.path + "|" + std::to_string(source.flip_v) + "|" +
                            std::to_string(source.shape_index) + "|" + std::to_string(source.lacks_materials);
    job.source = add_source(std::move(source), key);
}

void ShapeBuilder::read_tessellated(Reader& in, Job& job, const Matrix& outer) {
    const std::string name = in.text("filename", "");
    if (name.empty()) in.fail_without("filename", job.type + " shape has no filename");
    const std::string path = builder.file(name, in.where("filename"));
    const bool grid = job.type == "sdfgrid", field = job.type == "heightfield";
    const double scale = field ? in.number("scale", 1) : 1;
    const bool smooth = field && in.boolean("shading_normals", true);
    job.face_normals = field && !smooth;
    const std::string normals = grid ? in.text("normals", "smooth") : "";
    if (grid && normals != "smooth" && normals != "analytic")
        in.fail(in.where("normals"), "'" + normals + "' are no normals of an sdfgrid: smooth or analytic");
    // Radii of curves do not follow the shape's own transform, its points do.
    const bool follows = grid || field;
    const Matrix placed = follows ? Matrix{} : in.transform("to_world");
    if (!follows) job.to_world = outer;
    std::string key = path + "|" + job.type + normals + std::to_string(scale) + std::to_string(smooth);
    for (const auto& row : placed.m)
        for (double m : row) (key += '|') += std::to_string(float_bits(float(m)));
    if (const auto known = source_by_key.find(key); known != source_by_key.end()) {
        job.source = known->second;
        return;
    }
    const Limits& limits = builder.options.limits;
    const std::string bytes = read_input(path, limits);
    builder.file_digests.push_back({path, sha256(bytes)});
    MeshSource source;
    source.type = job.type;
    if (field) {
        const Texels texels = read_image(path, bytes, limits);
        note_image(builder.scene.notes, path, texels.notes);
        source.mesh = mesh_of_image(path, texels, scale, smooth, limits);
    } else if (grid) {
        source.mesh = mesh_of_grid(path, read_distance_grid(path, bytes, limits),
                                   normals == "smooth" ? GridNormals::smooth : GridNormals::analytic);
    } else {
        std::vector<Curve> curves = read_curves(path, bytes, limits);
        for (Curve& curve : curves)
            for (CurvePoint& c : curve) c.p = transformed(placed, c.p);
        source.mesh = job.type == "linearcurve" ? mesh_of_linear_curves(curves) : mesh_of_bspline_curves(path, curves);
    }
    builder.note(in.where(), "shapes of type '" + job.type +
                                 "' are triangles: " + std::to_string(source.mesh.faces.size()) + " of them here");
    job.source = add_source(std::move(source), key);
}

uint32_t ShapeBuilder::add_emitter(const Object& object) {
    Emitter e = read_emitter(builder, object, true);
    if (e.type == EmitterType::count) {
        builder.refuse(object.where,
                       "emitter type '" + object.type + "' on a shape is not supported" +
                           (is_one_of(emitter_plugins(), object.type) ? ": it belongs in the scene"
                                                                      : what_is_meant("emitter", object.type)),
                       "the shape does not emit");
        e.type = EmitterType::area;
    }
    builder.scene.emitters.push_back(e);
    return uint32_t(builder.scene.emitters.size() - 1);
}

void ShapeBuilder::add_instance(const Object& object, const Matrix& outer) {
    Reader in(builder, object);
    const Object* group = in.take("shape");
    if (!group || group->type != "shapegroup") in.fail("instance has no shapegroup");
    Job job;
    job.where = object.where;
    job.type = object.type;
    job.to_world = outer * in.transform("to_world");
    if (!(std::fabs(determinant(job.to_world)) > 0))
        in.fail(in.where("to_world"), "the transform of the instance is singular");
    in.finish();
    const auto [known, is_new] = group_of.try_emplace(group, int(groups.size()));
    if (is_new) {
        std::vector<Job> others = std::exchange(jobs, {});
        Reader group_in(builder, *group);
        while (const Object* shape = group_in.take("shape")) add_shape(*shape, {}, true);
        group_in.finish();
        groups.push_back({std::exchange(jobs, std::move(others)), {}, {}});
    }
    job.group = known->second;
    add_job(std::move(job), false);
}

uint64_t memory_of(const Mesh& mesh) { return mesh_bytes(mesh.positions.size(), mesh.faces.size()); }

/// The geometry of the scene before, if that has the same shapes in the same places.
bool ShapeBuilder::take_over() {
    const Kept* before = builder.before;
    if (!before || keys.empty() || before->geometry.keys != keys) return false;
    const KeptGeometry& geometry = builder.geometry = before->geometry;
    const Scene& old = before->scene;
    Scene& scene = builder.scene;
    for (uint32_t i = 0; i < old.shapes.size(); ++i)  // a light that has no area: to be refused where it is placed
        if (!old.shapes[i].primitive_count && materials_and_emitters[geometry.of_shape[i]].second != kNone)
            return false;
    scene.vertices = old.vertices, scene.triangles = old.triangles, scene.quadrics = old.quadrics;
    scene.groups = old.groups, scene.instances = old.instances, scene.shapes = old.shapes;
    scene.degenerate_triangles = old.degenerate_triangles;
    for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
        const auto [material, emitter] = materials_and_emitters[geometry.of_shape[i]];
        scene.shapes[i].material = material, scene.shapes[i].emitter = emitter;
        if (emitter != kNone) scene.emitters[emitter].shape = i;
    }
    builder.take_memory(geometry.memory, scene.path);
    const auto add = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    add(builder.file_digests, geometry.digests);
    add(scene.warnings, geometry.warnings);
    add(scene.notes, geometry.notes);
    return true;
}

/// Reads the meshes, and puts all into the scene.
void place_shapes(Builder& builder, ShapeBuilder& shapes) {
    load_sources(builder, shapes.sources, shapes.jobs, shapes.groups);
    place_instances(builder, shapes.groups, shapes.sources, shapes.jobs);
    // Shapes get meshes of their own, and so does the scene.
    for (const MeshSource& s : shapes.sources) builder.take_memory(memory_of(s.content()), s.path);
    for (const Job& job : shapes.jobs)
        if (job.source >= 0) {
            const Mesh& mesh = shapes.sources[size_t(job.source)].content();
            const uint64_t split = job.smooth_angle >= 0 ? mesh_bytes(3 * mesh.faces.size(), mesh.faces.size()) : 0;
            builder.take_memory(2 * (memory_of(mesh) + split), job.where.file + ":" + std::to_string(job.where.line));
        }
    parallel_for(shapes.jobs.size(), [&](size_t i) {
        Job& job = shapes.jobs[i];
        if (job.source >= 0) transform_mesh(builder, job, shapes.sources[size_t(job.source)].content());
    });

    Scene& scene = builder.scene;
    reserve_meshes(shapes.jobs, scene);
    std::vector<uint32_t> group_ends;
    int group = -1;
    for (Job& job : shapes.jobs) {
        const uint32_t index = uint32_t(scene.shapes.size());
        if (job.group != group) group = job.group, group_ends.push_back(uint32_t(scene.triangles.size()));
        Shape shape{job.material, job.emitter, 0, 0, 0, 0};
        if (job.emitter != kNone) scene.emitters[job.emitter].shape = index;
        if (job.source >= 0) {
            add_mesh(builder, job, index, shape);
            job.world = {};
        } else {
            Quadric q = make_quadric(builder, job);
            q.shape = index;
            shape.first_primitive = uint32_t(scene.quadrics.size());  // moved behind the triangles below
            shape.primitive_count = 1;
            scene.quadrics.push_back(q);
        }
        scene.shapes.push_back(shape);
        builder.geometry.of_shape.push_back(job.origin);
    }
    for (const Quadric& q : scene.quadrics) scene.shapes[q.shape].first_primitive += uint32_t(scene.triangles.size());
    group_ends.push_back(uint32_t(scene.triangles.size()));
    add_instances(builder, shapes.groups, group_ends);
}

}  // namespace

void build_shapes(Builder& builder, const Object& root) {
    ShapeBuilder shapes{builder, {}, {}, {}, {}, {}, {}, {}};
    for (const Child& child : root.children)
        if (child.object->tag == "shape") shapes.add_shape(*child.object, builder.to_scene, false);
    if (!shapes.keys_tell_all) shapes.keys.clear();
    if (shapes.take_over()) return;
    const auto digests = ptrdiff_t(builder.file_digests.size()), warnings = ptrdiff_t(builder.scene.warnings.size()),
               notes = ptrdiff_t(builder.scene.notes.size());
    const uint64_t memory = builder.memory;
    place_shapes(builder, shapes);
    KeptGeometry& kept = builder.geometry;
    kept.keys = std::move(shapes.keys);
    kept.digests.assign(builder.file_digests.begin() + digests, builder.file_digests.end());
    kept.warnings.assign(builder.scene.warnings.begin() + warnings, builder.scene.warnings.end());
    kept.notes.assign(builder.scene.notes.begin() + notes, builder.scene.notes.end());
    kept.memory = builder.memory - memory;
}

const Plugins& shape_plugins() {
    static const Plugins known = {"obj",    "ply",     "serialized",  "rectangle",    "cube",
                                  "sphere", "disk",    "cylinder",    "shapegroup",   "instance",
                                  "merge",  "sdfgrid", "linearcurve", "bsplinecurve", "heightfield"};
    return known;
}

}  // namespace ambilux::document
