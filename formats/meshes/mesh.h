// Triangle meshes in object space, and the readers of mesh files.
#pragma once

#include <array>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/vec.h"
#include "formats/limits.h"

namespace ambilux {

/// Colours or numbers (then all three are the same) of the vertices or triangles of a mesh, by Mitsuba's names:
/// vertex_color, face_weight.
struct MeshAttribute {
    std::string name;
    bool per_face = false;
    uint32_t channels = 0;  ///< in the file
    std::vector<Rgb> values;
    std::string property = {};  ///< that the first channel comes from
    float most = 1;             ///< of the type of a colour in whole numbers, which `values` are parts of
};

/// Indexed triangles. `normals` and `uvs` hold one entry per vertex, or none at all. Normals need not be unit.
struct Mesh {
    std::vector<Vec3f> positions, normals;
    std::vector<Vec2f> uvs;
    std::vector<std::array<uint32_t, 3>> faces;
    std::vector<MeshAttribute> attributes;
    /// Where the positions' origin lies in the file's coordinates: floats far from 0 would lose what doubles have.
    std::array<double, 3> origin{};
    std::vector<std::string> notes;  ///< what the file has and the mesh has not
};

/// Wavefront OBJ: v, vt, vn and f with positive or negative indices and any number of corners (polygons.h).
/// Vertices with the same triple of indices are shared. Faces of two corners and other statements are left out.
/// `flip_v`: v becomes 1-v (Mitsuba's flip_tex_coords). `path` is for messages. A file without faces is refused, as by
/// all readers. Colours behind the places of vertices are kept if `attributes` has vertex_color.
Mesh read_obj(const std::string& path, std::string_view text, bool flip_v, const Limits& limits = {},
              const std::set<std::string>& attributes = {});

/// Stanford PLY, ascii or binary of either byte order: coordinates, normals, texture coordinates, colours, faces and
/// triangle strips by the names that programs give them (ply_header.cpp). Properties NAME_0 to NAME_2, and colours as
/// NAME color, are attributes, of which those in `attributes` are kept. What the file has beside is in Mesh::notes.
/// Vertices whose corners have texture coordinates of their own that differ are divided.
Mesh read_ply(const std::string& path, std::string_view bytes, bool flip_v, const Limits& limits = {},
              const std::set<std::string>& attributes = {});
/// Whether a PLY file that begins with these bytes has texture coordinates.
bool ply_has_uvs(const std::string& path, std::string_view bytes);

/// Mitsuba's .serialized format, version 3 or 4; `shape_index` picks one of the meshes in the file.
Mesh read_serialized(const std::string& path, std::string_view bytes, int shape_index, bool flip_v,
                     const Limits& limits = {});

/// Two triangles that span [-1,1]² at z = 0, normal +z, uv in [0,1]².
Mesh make_rectangle();

/// The cube [-1,1]³, normals outwards, each face with uv in [0,1]², oriented as in Mitsuba's `cube`.
Mesh make_cube();

/// Vertex normals as means of the adjacent faces' normals, weighted by the angle at the vertex (Thürmer and Wüthrich
/// 1998). Vertices without a proper face get (0,0,0).
std::vector<Vec3f> smooth_normals(const Mesh& mesh);

/// The mesh without normals, its vertices divided so that smooth_normals() does not smooth over edges of more than
/// `degrees` between the normals of faces: of the faces around a point (position and uv), in their order, each that has
/// no vertex yet gets one, together with all whose normals lie within the angle (Mitsuba 0.6, maxSmoothAngle).
Mesh split_at_edges(const std::string& path, const Mesh& mesh, double degrees);

/// Appends a vertex of `from`, which may be the same mesh, with those attributes that `to` has too; its index.
uint32_t append_vertex(Mesh& to, const Mesh& from, uint32_t v);
/// The mesh with vertices of its own for every face, in the order of faces and corners; without texture coordinates.
Mesh with_own_corners(const Mesh& mesh);
/// Two faces for every cell of a grid of vertices, of `nx` cells a row, from the vertex `first` on.
void add_grid_faces(Mesh& mesh, uint32_t first, uint32_t nx, uint32_t ny);

/// Memory of a mesh of that many vertices and triangles, at most.
uint64_t mesh_bytes(uint64_t vertices, uint64_t triangles);

/// Positions about their middle, if they are far from 0 for their extent.
void set_positions(Mesh& mesh, const std::vector<std::array<double, 3>>& points);

/// Throws Error(bad_input) if there is no face, a coordinate is not finite, an index is out of range, or an attribute
/// is not there for every vertex. Normals that are not finite become none, with a note.
void check_mesh(const std::string& path, Mesh& mesh);

}  // namespace ambilux
