// Shapes on their way into a scene.
#pragma once

#include "formats/meshes/mesh.h"
#include "formats/mitsuba/builder.h"

namespace ambilux::mitsuba {

/// A mesh file read with certain settings, or a mesh of the document; shared by all shapes that name it.
struct MeshSource {
    std::string path, type;
    bool flip_v = false;
    int shape_index = 0;
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
    double smooth_angle = -1;  ///< not negative: vertex normals are made anew, but not over sharper edges; degrees
    // Result for meshes.
    Mesh world;
    uint32_t dropped = 0;
    bool vanished = false;  ///< had area before its transform, and none of it is left
};

/// Moves a mesh to world space, orients it and leaves out triangles without area.
void transform_mesh(const Builder& builder, Job& job, const Mesh& mesh);

/// True if a texture of the BSDF takes its values from the mesh. Fails if others do not, since they would need
/// coordinates of their own.
bool has_mesh_attributes(const Object& bsdf);

/// The mesh with vertices and coordinates of its own for every triangle, so that `textures`, one for every attribute,
/// have its values between them: blocks of 2x2 texels, in which a bilinear lookup is linear.
Mesh with_attribute_atlas(Builder& builder, const std::string& path, const Mesh& mesh,
                          std::map<std::string, int32_t>& textures);

/// Sphere, disk or cylinder.
Quadric make_quadric(Builder& builder, const Job& job);

}  // namespace ambilux::mitsuba
