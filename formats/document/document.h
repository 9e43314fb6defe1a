// A scene as a tree of objects, as Mitsuba's XML has it: what the readers of all formats make, and what a Scene is
// built from. Plugins and parameters are Mitsuba's, in the snake_case of format 2 and later.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/sha256.h"
#include "core/vec.h"
#include "formats/document/transform.h"
#include "formats/images/image_io.h"
#include "formats/limits.h"
#include "formats/load.h"
#include "formats/meshes/mesh.h"

namespace ambilux::document {

/// What exporters round to just above 1, by up to a step of a half, counts as 1.
constexpr float kRoundedOne = 1.001f;
inline float without_rounding(float v) { return v > 1 && v <= kRoundedOne ? 1 : v; }

/// Where something stands in the input.
struct Where {
    std::string file;
    int line = 0;  ///< 0: the file as a whole

    std::string text() const { return line ? file + ":" + std::to_string(line) : file; }
};

/// Throws Error(bad_input).
[[noreturn]] void fail(const Where& where, const std::string& message);

enum class ValueKind { boolean, integer, number, text, vector, rgb, spectrum, transform };

/// One parameter of an object.
struct Value {
    std::string name;
    ValueKind kind = ValueKind::text;
    Where where;
    std::string text;   ///< text
    double number = 0;  ///< number; integer; boolean (0 or 1); spectrum with a single value
    Rgb rgb{};
    Vec3d vector{};
    std::vector<std::pair<double, double>> samples;  ///< spectrum: (wavelength in nm, value), rising
    bool equal_energy = false;  ///< spectrum: `number` at all wavelengths, which is no white as a light
    Matrix transform;
};

struct Object;

/// An object inside of another, or a reference to one.
struct Child {
    std::string name;  ///< may be empty
    Where where;
    std::string ref;  ///< id of the object, until it is resolved
    const Object* object = nullptr;
};

/// scene, sensor, film, rfilter, sampler, integrator, shape, bsdf, texture, emitter, ...
struct Object {
    std::string tag, type, id;
    Where where;
    int version = 3;  ///< major version of the file it came from; 0 and 1 are the older generation
    std::vector<Value> values;
    std::vector<Child> children;

    const Value* find(const std::string& name) const;
};

/// A parsed scene file with all that it includes.
struct Document {
    std::vector<std::unique_ptr<Object>> storage;
    Object* scene = nullptr;
    std::map<std::string, const Object*> ids;
    std::vector<std::string> search_folders;  ///< of <path>, in order
    /// Path and text of the scene files read.
    std::vector<std::pair<std::string, std::shared_ptr<const std::string>>> files;
    std::map<std::string, Where> included_from;  ///< of those that others include: by which
    Limits limits;

    // What front ends of other formats hand over (formats/pbrt, formats/gltf).
    std::map<std::string, Mesh> meshes;    ///< of shapes of type "mesh", by their "name"
    std::map<std::string, Texels> images;  ///< of textures of type "image" and emitters of type "envmap", by "image"
    std::vector<std::pair<std::string, Sha256Digest>> file_digests;  ///< of other files that were read
    std::vector<std::string> warnings, notes;
    uint64_t made_texels = 0;             ///< bytes of images that front ends made (take_texels)
    std::set<const Object*> light_backs;  ///< shapes that are the other side of another one's light, just behind it
    bool smooth_normals = true;           ///< meshes without normals get smooth ones, as in Mitsuba
    bool mirrors_turn_in = true;          ///< mirrored meshes of files, and spheres, turn in, as in Mitsuba 2 and 3

    bool clips_reflectances = false;  ///< textures that reflect more than 1 reflect 1, as in pbrt and glTF

    // What edits add (formats/edits.h).
    std::shared_ptr<const Document> first;  ///< that this one began as: it has `meshes` and `images`; null: none
    std::map<std::string, std::shared_ptr<const Mesh>> given_meshes;
    std::map<std::string, std::shared_ptr<const Texels>> given_images;
    std::map<std::string, std::string> edits;  ///< by the names of what was changed, as text

    /// By its name, or null.
    const Mesh* mesh(const std::string& name) const;
    bool has_meshes() const { return !meshes.empty() || !given_meshes.empty() || first; }
    const Texels* image(const std::string& name) const;

    /// Path of a file named in `where.file`: in the <path> folders, the last one first, then in the folder of the main
    /// file, as in Mitsuba, and then in that of the file that names it. Throws Error(bad_input) if there is none.
    std::string resolve(const std::string& name, const Where& where) const;
};

/// What `load` returns. What it throws of a file that others include names those too.
Scene naming_includes(const Document& document, const std::function<Scene()>& load);

/// Throws Error(bad_input) if objects contain themselves or, each counted as often as it is referred to, are more or
/// nested deeper than the limits allow.
void check_references(const Document& document);

/// Throw Error(bad_input) where the scene has more than `count` says is allowed: shapes in all, and `what` in each
/// other.
void check_shapes(const Limits& limits, uint64_t count, const Where& where);
void check_nesting(const Limits& limits, uint64_t depth, const Where& where, const char* what);

/// An object of no document.
Object make_object(const std::string& tag, const std::string& type, const Where& where, int version = 3);
/// A new object of the document, of format 2.
Object& add_object(Document& document, const std::string& tag, const std::string& type, const Where& where);
/// The same, in the scene.
Object& add_to_scene(Document& document, const std::string& tag, const std::string& type, const Where& where);
/// Calls f once for the object and each below it.
void for_all_below(const Object& object, const std::function<void(const Object&)>& f);
/// Before a front end makes an image of its own: throws Error(bad_input) where one or all are more than the limits
/// allow.
void take_texels(Document& document, const Where& where, uint64_t texels, uint64_t bytes_each);
/// An image of the document, of linear floats that are 1.
Texels& add_image(Document& document, const std::string& name, uint32_t width, uint32_t height);
/// A texture of an image of the document, its values as they are, and not repeated.
Object& add_bitmap(Document& document, const Where& where, const std::string& image, const char* filter = "bilinear");
/// What the file of an image says of itself and is not taken as it says, each once.
void note_image(std::vector<std::string>& notes, const std::string& path, const std::vector<std::string>& of_image);
/// Texels of a file, its digest and what there is to say of it.
Texels read_image_file(Document& document, const std::string& path);
/// The same shape turned over, for a light of two sides; to be added behind the shape, once that is complete.
Object& add_light_back(Document& document, const Object& shape);
void add_child(Object& parent, const Object& child, const std::string& name = "");
void set_boolean(Object& object, const std::string& name, bool value);
void set_integer(Object& object, const std::string& name, int64_t value);
void set_number(Object& object, const std::string& name, double value);
void set_text(Object& object, const std::string& name, const std::string& value);
void set_rgb(Object& object, const std::string& name, Rgb value);
void set_vector(Object& object, const std::string& name, Vec3d value);
void set_transform(Object& object, const std::string& name, const Matrix& value);

struct Kept;

/// The finished scene. `path` is for messages. With LoadOptions::editable, what is the same in its `kept` is taken
/// over, and that of this scene is left there.
Scene load_document(const std::string& path, const std::shared_ptr<const Document>& document,
                    const LoadOptions& options);

}  // namespace ambilux::document
