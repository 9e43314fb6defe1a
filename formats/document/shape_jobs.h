// Shapes on their way into a scene.
#pragma once

#include "formats/document/builder.h"
#include "formats/meshes/mesh.h"

namespace ambilux::document {

/// A mesh file read with certain settings, or a mesh of the document; shared by all shapes that name it.
struct MeshSource {
    std::string path, type;
    bool flip_v = false;
    int shape_index = 0;
    bool lacks_materials = false;  ///< obj: its shape would have them from an .mtl file, if there is one
    std::string key;               ///< what its content depends on
    Mesh mesh;
    const Mesh* given = nullptr;  ///< of the document, instead of `mesh`
    Sha256Digest digest{};

    const Mesh& content() const { return given ? *given : mesh; }
};

/// A shape on its way into the scene.
struct Job {
    Where where;
    std::string type;
    Matrix to_world;
    uint32_t material = 0, emitter = kNone;
    int source = -1;  ///< meshes: index into the sources
    bool flip = false, face_normals = false;
    bool reverse = false;      ///< meshes: the order of corners, so that the outside stays outside of a mirror
    bool light_back = false;   ///< lies just behind another shape (Document::light_backs)
    double smooth_angle = -1;  ///< not negative: vertex normals are made anew, but not over sharper edges; degrees
    int group = -1;            ///< its place in the groups: of instances, and of meshes that instances share
    uint32_t origin = 0;       ///< which of the shapes of the document it is, or a copy of
    // Result for meshes.
    Mesh world;
    uint32_t dropped = 0;
    bool vanished = false;  ///< had area before its transform, and none of it is left
};

/// What a shapegroup holds, in its own coordinates.
struct GroupJobs {
    std::vector<Job> jobs;
    std::vector<Where> where;  ///< of the instances that share it, as everything below
    std::vector<Matrix> placements;
};

/// What a shape of type obj says of parts of its file, each of which can have its BSDF in the older generation.
void read_obj_parts(Builder& builder, Reader& in, MeshSource& source);

/// Reads the files of meshes that jobs have, also those of groups, on all threads; jobs get the origins of meshes.
void load_sources(Builder& builder, std::vector<MeshSource>& sources, std::vector<Job>& placed,
                  std::vector<GroupJobs>& groups);

/// Puts copies of what groups hold in the places of jobs of type "instance", or leaves it to be shared: meshes of
/// groups whose copies would have more than Limits::copies triangles. Their jobs then come last, group by group, around
/// the middle of the group. Fails where the scene would have too many shapes.
void place_instances(const Builder& builder, std::vector<GroupJobs>& groups, const std::vector<MeshSource>& sources,
                     std::vector<Job>& jobs);

/// Adds groups and instances to a scene that has the triangles; `ends` are those of the groups.
void add_instances(const Builder& builder, const std::vector<GroupJobs>& groups, const std::vector<uint32_t>& ends);

/// Moves a mesh to world space, orients it and leaves out triangles without area.
void transform_mesh(const Builder& builder, Job& job, const Mesh& mesh);

/// Attributes of the mesh that textures of the BSDF take their values from. Fails if others do not, since they would
/// need coordinates of their own.
std::set<std::string> mesh_attributes_of(const Object& bsdf);

/// The PLY file of a shape with these attributes. Colours of vertices in files of the older generation are sRGB unless
/// the shape says otherwise (`srgb`).
Mesh read_with_attributes(Builder& builder, Reader& in, const MeshSource& source, const std::set<std::string>& names);

/// The mesh with vertices and coordinates of its own for every triangle, so that `textures`, one for every attribute,
/// have its values between them: blocks of 2x2 texels, in which a bilinear lookup is linear.
Mesh with_attribute_atlas(Builder& builder, const std::string& path, const Mesh& mesh,
                          std::map<std::string, int32_t>& textures);

/// Before the first add_mesh().
void reserve_meshes(const std::vector<Job>& jobs, Scene& scene);
/// Puts the mesh of a job into the scene, as that of the shape with this index.
void add_mesh(Builder& builder, const Job& job, uint32_t index, Shape& shape);

/// Transform of a sphere (center, radius) or cylinder (p0, p1, radius) in its own space.
Matrix local_form(Reader& in, const std::string& type);
/// Sphere, disk or cylinder.
Quadric make_quadric(Builder& builder, const Job& job);

}  // namespace ambilux::document
