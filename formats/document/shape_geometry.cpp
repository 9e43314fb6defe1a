#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "accel/range.h"
#include "core/error.h"
#include "core/parallel.h"
#include "formats/document/shape_jobs.h"

namespace ambilux::document {

namespace {

/// Vertices that are worth a task of their own.
constexpr size_t kGrain = 4096;

/// Image of a point, rounded once.
Vec3f point_of(const Matrix& a, Vec3f p) {
    const auto row = [&](int i) { return float(a.m[i][0] * p.x + a.m[i][1] * p.y + a.m[i][2] * p.z + a.m[i][3]); };
    return {row(0), row(1), row(2)};
}

/// Twice the area of a triangle along its normal; in double, since the area of a small triangle may be no float.
Vec3d area_normal(Vec3f a, Vec3f b, Vec3f c) { return cross(in_double(b) - in_double(a), in_double(c) - in_double(a)); }

/// How far the back of a light lies behind its front, in shares of its extent and of its coordinates: several roundings
/// of a ray's origin.
constexpr float kBackOfExtent = 1e-5f, kBackOfCoordinate = 4e-6f;

void move_behind(Mesh& mesh) {
    if (mesh.positions.empty()) return;
    Vec3f lower = mesh.positions[0], upper = lower;
    for (const Vec3f& p : mesh.positions) lower = min(lower, p), upper = max(upper, p);
    const float distance = std::max(kBackOfExtent * max_component(upper - lower),
                                    kBackOfCoordinate * max_component(max(abs(lower), abs(upper))));
    const std::vector<Vec3f> normals = mesh.normals.empty() ? smooth_normals(mesh) : mesh.normals;
    for (size_t i = 0; i < normals.size(); ++i) mesh.positions[i] += normals[i] * distance;
}

/// The same of a quadric's transform: outside of one that shines inwards, inside of one that shone outwards.
void move_behind(const Job& job, Matrix& m) {
    const double most = std::max({std::fabs(m.m[0][3]), std::fabs(m.m[1][3]), std::fabs(m.m[2][3])});
    const Vec3d x = column(m, 0), y = column(m, 1), z = column(m, 2);
    const double extent = std::max(length(x), length(y)),
                 distance = std::max(double(kBackOfExtent) * extent, double(kBackOfCoordinate) * (most + extent));
    if (job.type == "disk") {
        const Vec3d n = cross(x, y);
        const double side = (dot(n, z) < 0) == job.flip ? 1 : -1, l = length(n);
        m = translation(side * distance * n.x / l, side * distance * n.y / l, side * distance * n.z / l) * m;
        return;
    }
    const double factor = 1 + (job.flip ? -1 : 1) * distance / extent;
    m = m * scaling(factor, factor, job.type == "sphere" ? factor : 1);
}

void place_mesh(const Builder& builder, Job& job, const Mesh& source) {
    const bool split = job.smooth_angle >= 0 && !job.face_normals;
    const Mesh smooth = split ? split_at_edges(job.where.file, source, job.smooth_angle) : Mesh{};
    const Mesh& mesh = split ? smooth : source;
    const Affine to_local = to_affine(affine_inverse(job.to_world));
    Mesh& out = job.world;
    out.positions.resize(mesh.positions.size());
    parallel_for(
        mesh.positions.size(), [&](size_t i) { out.positions[i] = point_of(job.to_world, mesh.positions[i]); }, kGrain);
    for (const Vec3f& q : out.positions)
        if (!(max_component(abs(q)) <= kMostCoordinate) || !is_finite(q))
            builder.check_range(job.where, "the shape of type '" + job.type + "'", {{q.x, q.y, q.z}});
    out.uvs = mesh.uvs;
    const bool reverse = job.reverse != job.flip;
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

    if (job.face_normals || (mesh.normals.empty() && !builder.document.smooth_normals)) return;
    if (mesh.normals.empty()) {
        out.normals = smooth_normals(out);
    } else {
        const float sign = job.flip ? -1.0f : 1.0f;
        const auto normal_at = [&](size_t i) {
            const Vec3f w = to_local.transposed_vector(mesh.normals[i]) * sign;
            // Scaled by its largest entry first, because tiny or huge transforms leave the range of a square.
            const float largest = max_component(abs(w));
            return largest > 0 && largest < kInfinity ? normalize(w * (1.0f / largest)) : Vec3f{0, 0, 0};
        };
        out.normals.resize(mesh.normals.size());
        parallel_for(mesh.normals.size(), [&](size_t i) { out.normals[i] = normal_at(i); }, kGrain);
    }
    for (auto& f : out.faces) {
        const Vec3d n = normal_of(f);
        const double area = length(n);
        const Vec3f ng = rounded({n.x / area, n.y / area, n.z / area});
        Vec3f sum = {0, 0, 0};
        for (uint32_t v : f) {
            if (is_zero(out.normals[v])) out.normals[v] = ng;  // the file gives none here
            sum += out.normals[v];
        }
        // The geometric normal lies on the side of the vertex normals (B12).
        if (dot(ng, sum) < 0) std::swap(f[1], f[2]);
    }
}

}  // namespace

void transform_mesh(const Builder& builder, Job& job, const Mesh& source) {
    place_mesh(builder, job, source);
    if (job.light_back) move_behind(job.world);
}

Matrix local_form(Reader& in, const std::string& type) {
    const double radius = type == "disk" ? 1 : in.number("radius", 1);
    if (!(radius > 0)) in.fail(in.where("radius"), "radius must be positive");
    if (type == "sphere") {
        const Vec3d c = in.vector("center", {0, 0, 0});
        return translation(c.x, c.y, c.z) * scaling(radius, radius, radius);
    }
    if (type == "disk") return {};
    const Vec3d p0 = in.vector("p0", {0, 0, 0}), p1 = in.vector("p1", {0, 0, 1});
    const double l = length(p1 - p0);
    if (!(l > 0)) in.fail("cylinder has no length: p0 equals p1");
    // The frame of core/math.h (and of Mitsuba), in double: it decides where the azimuth starts.
    const Vec3d n = unit(p1 - p0);
    const double sign = std::copysign(1.0, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
    const Vec3d s = {1 + sign * n.x * n.x * a, sign * b, -sign * n.x}, t = {b, sign + n.y * n.y * a, -n.y};
    return from_columns(s, t, n, p0) * scaling(radius, radius, l);
}

Quadric make_quadric(Builder& builder, const Job& job) {
    Quadric q{};
    q.type = job.type == "sphere" ? PrimitiveType::sphere
                                  : (job.type == "disk" ? PrimitiveType::disk : PrimitiveType::cylinder);
    q.flip = job.flip;
    Matrix m = job.to_world;
    if (job.light_back) move_behind(job, m);
    const Vec3d x = column(m, 0), y = column(m, 1), z = column(m, 2);
    const double lx = length(x), ly = length(y), lz = length(z);
    if (q.type == PrimitiveType::disk) {
        // Any affine map of a disk is fine: an ellipse. The radius bounds it.
        q.radius = float(std::sqrt(lx * lx + ly * ly));
        if (is_orthogonal(m, 1e-6)) q.radius = float(std::max(lx, ly));
    } else {
        const double radius = q.type == PrimitiveType::sphere ? (lx + ly + lz) / 3 : (lx + ly) / 2;
        if (!keeps_round(m, q.type == PrimitiveType::sphere))
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
        fail(job.where,
             fmt::format("the shape of type '{}' is {:g} wide, less than {:g}", job.type, least, kLeastExtent));
    q.to_world = to_affine(m);
    q.to_local = to_affine(affine_inverse(m));
    return q;
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

}  // namespace ambilux::document
