// What the parts of the glTF reader share.
#pragma once

#include <tiny_gltf.h>

#include <map>
#include <set>
#include <string_view>

#include "formats/report.h"

namespace ambilux::gltf {

using document::Document;
using document::Matrix;
using document::Object;
using document::Where;

struct Context {
    Document& document;
    Report& report;
    Where where;  ///< the file; glTF has no lines
    tinygltf::Model model;
    std::vector<std::string> image_bytes;  ///< of each image, as in its file
    std::map<int, std::string> images;     ///< in the document, by image
    struct Surface {
        const Object* bsdf = nullptr;
        const Object* emitter = nullptr;
        int tex_coord = 0;          ///< set of texture coordinates that all its textures use
        bool double_sided = false;  ///< opaque, and what shines does so on both sides
        bool has_normals = false;   ///< of a texture
        bool has_textures = false;
    };
    std::map<std::string, Surface> materials;  ///< by index and colours of vertices
    bool emits = false;

    [[noreturn]] void fail(const std::string& message) const;
    void note(const std::string& text) { report.note(where, text); }
    void refuse(const std::string& problem, const std::string& instead) { report.refuse(where, problem, instead); }
    /// A number that glTF has from 0 to 1.
    double at_most_1(double value, const std::string& what);
    /// A part of an extension that is not supported: refused only where the file says that nobody can do without it.
    void leave_out(const std::string& extension, const std::string& what, const std::string& hint = "");
};

/// Notes properties and extensions of other names than those that are known. `json`: of the file.
void check_names(Context& context, std::string_view json);

/// Reads the file with its buffers and images. Sets what a Context needs of them.
void read_model(Context& context, const std::string& path);

/// All values of an accessor, `components` of each element, normalized integers as shares of 1. Checked against the
/// buffers. `what` is for messages.
std::vector<double> accessor_values(const Context& context, int accessor, int components, const std::string& what);
/// The same where all values must be whole numbers from 0 to below `limit`.
std::vector<uint32_t> accessor_indices(const Context& context, int accessor, int components, size_t limit,
                                       const std::string& what);

/// The bytes of a view, which lie inside of its buffer. Throws Error(bad_input).
std::pair<const unsigned char*, uint64_t> view_bytes(const Context& context, int index, const std::string& what);

/// What moves the vertices of a mesh at a node.
struct Pose {
    std::vector<Matrix> joints;   ///< of its skin, from the mesh to the world; empty: no skin
    std::vector<double> weights;  ///< of morph targets
};

/// COLOR_0: factors of the base colour and its alpha.
struct VertexColors {
    bool varies = false, alpha_varies = false;
    Rgb color = {1, 1, 1};  ///< of the first vertex, and of all unless it varies
    double alpha = 1;
    std::vector<Rgb> values, alphas;
};
VertexColors vertex_colors(Context& context, const tinygltf::Primitive& primitive, const std::string& what);

/// Triangles of a primitive, with the set of texture coordinates that its material wants.
Mesh primitive_mesh(Context& context, const tinygltf::Primitive& primitive, int tex_coord, const Pose& pose,
                    const VertexColors& colors, const std::string& what);

/// The faces that show their texture in a mirror, as a mesh of their own; they leave `mesh`. `in_mirror`: it stands in
/// a place that mirrors it.
Mesh take_mirrored(Mesh& mesh, bool in_mirror);

/// Triangles of about one colour each, whose mean `colors` is.
struct ColoredPart {
    Mesh mesh;
    VertexColors colors;
};
std::vector<ColoredPart> parts_by_color(const Mesh& mesh, const VertexColors& colors);

/// What a material has to know of the mesh.
struct Use {
    VertexColors colors;
    bool mirrored = false;  ///< it shows its textures in a mirror
    bool tangents = false;  ///< they are given, and do not follow KHR_texture_transform
};
/// Material -1 is the default.
Context::Surface surface(Context& context, int material, const Use& use);
/// True if it has textures, and colours of vertices that would have to have coordinates of their own.
bool has_colored_textures(const Context& context, int material, const VertexColors& colors);

/// Numbers in extensions of objects.
const tinygltf::Value* extension(const tinygltf::ExtensionMap& extensions, const char* name);
double number(const tinygltf::Value* object, const char* name, double fallback);
/// An index: -1 for numbers below it.
int integer(const tinygltf::Value* object, const char* name, int fallback);

/// Emitters and the camera of a node.
void add_light(Context& context, const tinygltf::Light& light, const Matrix& to_world);
Object& add_camera(Context& context, const tinygltf::Camera& camera, Matrix to_world);
/// A camera that sees the box.
Object& add_default_camera(Context& context, Vec3f lower, Vec3f upper);

}  // namespace ambilux::gltf
