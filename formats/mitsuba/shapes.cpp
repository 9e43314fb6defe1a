#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "accel/range.h"
#include "core/error.h"
#include "core/parallel.h"
#include "formats/file_budget.h"
#include "formats/meshes/mesh.h"
#include "formats/mitsuba/builder.h"

namespace ambilux::mitsuba {

namespace {

/// A mesh file read with certain settings; shared by all shapes that name it.
struct MeshSource {
    std::string path, type;
    bool flip_v = false;
    int shape_index = 0;
    Mesh mesh;
    Sha256Digest digest{};
};

/// A shape on its way into the scene.
struct Job {
    Where where;
    std::string type;
    Matrix to_world;
    uint32_t material = 0, emitter = kNone;
    int source = -1;  ///< meshes: index into the sources
    bool flip = false, face_normals = false;
    // Result for meshes.
    Mesh world;
    uint32_t dropped = 0;
    bool vanished = false;  ///< had area before its transform, and none of it is left
};

struct ShapeBuilder {
    Builder& builder;
    std::vector<MeshSource> sources;
    std::map<std::string, int> source_by_key;
    std::vector<Job> jobs;

    int add_source(MeshSource source, const std::string& key) {
        const auto [it, added] = source_by_key.try_emplace(key, int(sources.size()));
        if (added) sources.push_back(std::move(source));
        return it->second;
    }

    void add_shape(const Object& object, const Matrix& outer, bool in_instance, bool in_group);
    void add_instance(const Object& object, const Matrix& outer);
    void read_geometry(Reader& in, Job& job);
    void read_mesh_file(Reader& in, Job& job);
    uint32_t add_emitter(const Object& object);
};

bool is_quadric(const std::string& type) { return type == "sphere" || type == "disk" || type == "cylinder"; }
bool is_mesh_file(const std::string& type) { return type == "obj" || type == "ply" || type == "serialized"; }

/// Transform of a sphere (center, radius) or cylinder (p0, p1, radius) in its own space.
Matrix local_form(Reader& in, const std::string& type) {
    const double radius = type == "disk" ? 1 : in.number("radius", 1);
    if (!(radius > 0)) in.fail(in.where("radius"), "radius must be positive");
    if (type == "sphere") {
        const Vec3d c = in.vector("center", {0, 0, 0});
        return translation(c.x, c.y, c.z) * scaling(radius, radius, radius);
    }
    if (type == "disk") return {};
    const Vec3d p0 = in.vector("p0", {0, 0, 0}), p1 = in.vector("p1", {0, 0, 1});
    const Vec3d axis = {p1.x - p0.x, p1.y - p0.y, p1.z - p0.z};
    const double l = length(axis);
    if (!(l > 0)) in.fail("cylinder has no length: p0 equals p1");
    // The frame of core/math.h (and of Mitsuba), in double: it decides where the azimuth starts.
    const Vec3d n = {axis.x / l, axis.y / l, axis.z / l};
    const double sign = std::copysign(1.0, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
    const Vec3d columns[4] = {
        {1 + sign * n.x * n.x * a, sign * b, -sign * n.x}, {b, sign + n.y * n.y * a, -n.y}, n, {p0.x, p0.y, p0.z}};
    Matrix frame;
    for (int j = 0; j < 4; ++j)
        frame.m[0][j] = columns[j].x, frame.m[1][j] = columns[j].y, frame.m[2][j] = columns[j].z;
    return frame * scaling(radius, radius, l);
}

void ShapeBuilder::add_shape(const Object& object, const Matrix& outer, bool in_instance, bool in_group) {
    Reader in(builder, object);
    if (object.type == "shapegroup") {
        if (in_group) in.fail("a shapegroup inside of a shapegroup is not supported");
        return;  // shown by its instances
    }
    if (object.type == "instance") {
        if (in_instance) in.fail("an instance inside of a shapegroup is not supported");
        add_instance(object, outer);
        return;
    }
    const std::string& type = object.type;
    if (!is_quadric(type) && !is_mesh_file(type) && type != "rectangle" && type != "cube") {
        builder.refuse(object.where, "shape type '" + type + "' is not supported", "the shape is left out");
        return;
    }

    Job job;
    job.where = object.where;
    job.type = type;
    job.to_world = outer * in.transform("to_world");
    if (!(std::fabs(determinant(job.to_world)) > 0))
        in.fail(in.where("to_world"), "the transform of the shape is singular");
    job.flip = in.boolean("flip_normals", false);
    read_geometry(in, job);
    const Object* bsdf = in.take("bsdf");
    const Object* emitter = in.take("emitter");
    if (emitter && in_instance)
        builder.refuse(emitter->where, "an emitter inside of a shapegroup is not supported", "the shape does not emit");
    else if (emitter)
        job.emitter = add_emitter(*emitter);
    job.material = bsdf ? build_material(builder, *bsdf) : default_material(builder, emitter != nullptr);
    in.finish();
    if (jobs.size() >= builder.options.limits.shapes)
        in.fail("the scene has more shapes than --limits shapes=" + std::to_string(builder.options.limits.shapes));
    jobs.push_back(std::move(job));
}

void ShapeBuilder::read_geometry(Reader& in, Job& job) {
    if (is_mesh_file(job.type)) {
        read_mesh_file(in, job);
    } else if (is_quadric(job.type)) {
        job.to_world = job.to_world * local_form(in, job.type);
    } else {
        MeshSource source;
        source.type = job.type;
        source.mesh = job.type == "rectangle" ? make_rectangle() : make_cube();
        job.source = add_source(std::move(source), job.type);
        job.face_normals = true;
    }
}

void ShapeBuilder::read_mesh_file(Reader& in, Job& job) {
    MeshSource source;
    const std::string name = in.text("filename", "");
    if (name.empty()) in.fail(job.type + " shape has no filename");
    source.path = builder.document.resolve(name, in.where("filename"));
    source.type = job.type;
    source.flip_v = in.boolean("flip_tex_coords", job.type == "obj");
    if (job.type == "serialized")
        source.shape_index = int(std::clamp<int64_t>(in.integer("shape_index", 0), -1, 1 << 30));
    job.face_normals = in.boolean("face_normals", false);
    if (job.type == "obj")
        in.ignore({"collapse"});  // older generation: one shape per group or one for all, which looks the same
    const std::string key =
        source.path + "|" + std::to_string(source.flip_v) + "|" + std::to_string(source.shape_index);
    job.source = add_source(std::move(source), key);
}

uint32_t ShapeBuilder::add_emitter(const Object& object) {
    Emitter e = read_emitter(builder, object, true);
    if (e.type == EmitterType::count) {
        builder.refuse(object.where, "emitter type '" + object.type + "' on a shape is not supported",
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
    const Matrix to_world = outer * in.transform("to_world");
    in.finish();
    Reader group_in(builder, *group);
    while (const Object* shape = group_in.take("shape")) add_shape(*shape, to_world, true, true);
    group_in.finish();
}

/// Image of a point, rounded once.
Vec3f point_of(const Matrix& a, Vec3f p) {
    const auto row = [&](int i) { return float(a.m[i][0] * p.x + a.m[i][1] * p.y + a.m[i][2] * p.z + a.m[i][3]); };
    return {row(0), row(1), row(2)};
}

/// Twice the area of a triangle along its normal; in double, since the area of a small triangle may be no float.
Vec3d area_normal(Vec3f a, Vec3f b, Vec3f c) {
    const auto from_a = [a](Vec3f p) { return Vec3d{double(p.x) - a.x, double(p.y) - a.y, double(p.z) - a.z}; };
    return cross(from_a(b), from_a(c));
}

/// Moves a mesh to world space, orients it and leaves out triangles without area.
void transform_mesh(const Builder& builder, Job& job, const Mesh& mesh) {
    const Affine to_local = to_affine(affine_inverse(job.to_world));
    Mesh& out = job.world;
    out.positions.reserve(mesh.positions.size());
    for (Vec3f p : mesh.positions) {
        const Vec3f q = point_of(job.to_world, p);
        out.positions.push_back(q);
        if (!(max_component(abs(q)) <= kMostCoordinate) || !is_finite(q))
            builder.check_range(job.where, "the shape of type '" + job.type + "'", {{q.x, q.y, q.z}});
    }
    out.uvs = mesh.uvs;
    // A reflection would turn the outside in: reverse the winding.
    const bool reverse = (determinant(job.to_world) < 0) != job.flip;
    out.faces = mesh.faces;
    if (reverse)
        for (auto& face : out.faces) std::swap(face[1], face[2]);

    const auto normal_of = [&](const std::array<uint32_t, 3>& f) {
        return area_normal(out.positions[f[0]], out.positions[f[1]], out.positions[f[2]]);
    };
    const size_t all = out.faces.size();
    std::erase_if(out.faces, [&](const auto& f) {
        const double area = length(normal_of(f));
        return !(area > 0 && std::isfinite(area));
    });
    job.dropped = uint32_t(all - out.faces.size());
    job.vanished = out.faces.empty() && std::any_of(mesh.faces.begin(), mesh.faces.end(), [&](const auto& f) {
                       return length(area_normal(mesh.positions[f[0]], mesh.positions[f[1]], mesh.positions[f[2]])) > 0;
                   });

    if (job.face_normals) return;
    if (mesh.normals.empty()) {
        out.normals = smooth_normals(out);
    } else {
        const float sign = job.flip ? -1.0f : 1.0f;
        for (Vec3f n : mesh.normals) {
            const Vec3f w = to_local.transposed_vector(n) * sign;
            // Scaled by its largest entry first, because tiny or huge transforms leave the range of a square.
            const float largest = max_component(abs(w));
            out.normals.push_back(largest > 0 && largest < kInfinity ? normalize(w * (1.0f / largest))
                                                                     : Vec3f{0, 0, 0});
        }
    }
    for (auto& f : out.faces) {
        const Vec3d n = normal_of(f);
        const double area = length(n);
        const Vec3f ng = {float(n.x / area), float(n.y / area), float(n.z / area)};
        Vec3f sum = {0, 0, 0};
        for (uint32_t v : f) {
            if (is_zero(out.normals[v])) out.normals[v] = ng;  // the file gives none here
            sum += out.normals[v];
        }
        // The geometric normal lies on the side of the vertex normals (B12).
        if (dot(ng, sum) < 0) std::swap(f[1], f[2]);
    }
}

Quadric make_quadric(Builder& builder, const Job& job) {
    Quadric q{};
    q.type = job.type == "sphere" ? PrimitiveType::sphere
                                  : (job.type == "disk" ? PrimitiveType::disk : PrimitiveType::cylinder);
    q.flip = job.flip;
    Matrix m = job.to_world;
    const Vec3d x = column(m, 0), y = column(m, 1), z = column(m, 2);
    const double lx = length(x), ly = length(y), lz = length(z);
    if (q.type == PrimitiveType::disk) {
        // Any affine map of a disk is fine: an ellipse. The radius bounds it.
        q.radius = float(std::sqrt(lx * lx + ly * ly));
        if (is_orthogonal(m, 1e-6)) q.radius = float(std::max(lx, ly));
    } else {
        const double radius = q.type == PrimitiveType::sphere ? (lx + ly + lz) / 3 : (lx + ly) / 2;
        const bool uniform = is_orthogonal(m, 1e-3) && std::fabs(lx - radius) < 1e-3 * radius &&
                             std::fabs(ly - radius) < 1e-3 * radius &&
                             (q.type == PrimitiveType::cylinder || std::fabs(lz - radius) < 1e-3 * radius);
        if (!uniform)
            builder.refuse(job.where, "a " + job.type + " with shear or non-uniform scale is not supported",
                           "the mean scale is used");
        // Make the axes exactly orthogonal and the scale exactly uniform, so that every formula sees the same shape.
        bool ignored = false;
        Matrix unit = m;
        const double lengths[3] = {lx, ly, lz};
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) unit.m[i][j] /= lengths[j];
        m = rigid_part(unit, ignored) * scaling(radius, radius, q.type == PrimitiveType::sphere ? radius : lz);
        q.radius = float(radius);
    }
    const Vec3d c = column(m, 3), top = column(m, 2);
    const double reach = q.type == PrimitiveType::cylinder ? q.radius + length(top) : double(q.radius);
    builder.check_range(job.where, "the shape of type '" + job.type + "'",
                        {{c.x - reach, c.y - reach, c.z - reach}, {c.x + reach, c.y + reach, c.z + reach}});
    const double least = std::min({lx, ly, q.type == PrimitiveType::disk ? lx : lz});
    if (!(least >= double(kLeastExtent)))
        throw input_error(
            job.where.file, job.where.line,
            fmt::format("the shape of type '{}' is {:g} wide, less than {:g}", job.type, least, kLeastExtent));
    q.to_world = to_affine(m);
    q.to_local = to_affine(affine_inverse(m));
    return q;
}

uint64_t memory_of(const Mesh& mesh) { return mesh_bytes(mesh.positions.size(), mesh.faces.size()); }

/// Reads the files of meshes, on all threads.
void load_sources(Builder& builder, std::vector<MeshSource>& sources) {
    parallel_for(sources.size(), [&](size_t i) {
        MeshSource& s = sources[i];
        if (s.path.empty()) return;
        const Limits& limits = builder.options.limits;
        const std::string bytes = read_input(s.path, limits);
        s.digest = sha256(bytes);
        if (s.type == "obj")
            s.mesh = read_obj(s.path, bytes, s.flip_v, limits);
        else if (s.type == "ply")
            s.mesh = read_ply(s.path, bytes, s.flip_v, limits);
        else
            s.mesh = read_serialized(s.path, bytes, s.shape_index, s.flip_v, limits);
    });
    for (const MeshSource& s : sources)
        if (!s.path.empty()) builder.file_digests.push_back({s.path, s.digest});
}

void reserve_meshes(const std::vector<Job>& jobs, Scene& scene) {
    size_t vertices = 0, triangles = 0;
    for (const Job& job : jobs) {
        vertices += job.world.positions.size();
        triangles += job.world.faces.size();
    }
    if (vertices >= kNone || triangles >= kNone / 2)
        throw input_error(scene.path, 0, "the scene has too many vertices or triangles");
    scene.vertices.reserve(vertices);
    scene.triangles.reserve(triangles);
}

void add_mesh(Builder& builder, const Job& job, uint32_t index, Shape& shape) {
    Scene& scene = builder.scene;
    const Mesh& mesh = job.world;
    if (job.emitter != kNone && mesh.faces.empty())
        builder.fail_unless_moved(input_error(job.where.file, job.where.line, "the shape emits light but has no area"));
    const std::string problem = "the shape of type '" + job.type + "' has no area: its transform leaves it none";
    if (job.vanished && builder.options.lenient)
        builder.refuse(job.where, problem, "it is left out");
    else if (job.vanished)
        builder.fail_unless_moved(input_error(job.where.file, job.where.line, problem));
    const uint32_t first = uint32_t(scene.vertices.size());
    shape.first_primitive = uint32_t(scene.triangles.size());
    shape.primitive_count = uint32_t(mesh.faces.size());
    if (!mesh.normals.empty()) shape.flags |= kShapeHasNormals;
    if (!mesh.uvs.empty()) shape.flags |= kShapeHasUvs;
    for (size_t v = 0; v < mesh.positions.size(); ++v) {
        const Vec2f uv = mesh.uvs.empty() ? Vec2f{0, 0} : mesh.uvs[v];
        scene.vertices.push_back(
            {mesh.positions[v], uv.x, mesh.normals.empty() ? Vec3f{0, 0, 0} : mesh.normals[v], uv.y});
    }
    for (const auto& f : mesh.faces) scene.triangles.push_back({first + f[0], first + f[1], first + f[2], index});
    scene.degenerate_triangles += job.dropped;
}

}  // namespace

void build_shapes(Builder& builder, const Object& root) {
    ShapeBuilder shapes{builder, {}, {}, {}};
    for (const Child& child : root.children) {
        if (child.object->tag == "shape") shapes.add_shape(*child.object, builder.to_scene, false, false);
    }
    load_sources(builder, shapes.sources);
    // Shapes get meshes of their own, and so does the scene.
    for (const MeshSource& s : shapes.sources) builder.take_memory(memory_of(s.mesh), s.path);
    for (const Job& job : shapes.jobs)
        if (job.source >= 0) {
            const Mesh& mesh = shapes.sources[size_t(job.source)].mesh;
            builder.take_memory(2 * memory_of(mesh), job.where.file + ":" + std::to_string(job.where.line));
        }
    parallel_for(shapes.jobs.size(), [&](size_t i) {
        Job& job = shapes.jobs[i];
        if (job.source >= 0) transform_mesh(builder, job, shapes.sources[size_t(job.source)].mesh);
    });

    Scene& scene = builder.scene;
    reserve_meshes(shapes.jobs, scene);
    for (Job& job : shapes.jobs) {
        const uint32_t index = uint32_t(scene.shapes.size());
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
    }
    for (const Quadric& q : scene.quadrics) scene.shapes[q.shape].first_primitive += uint32_t(scene.triangles.size());
}

}  // namespace ambilux::mitsuba
