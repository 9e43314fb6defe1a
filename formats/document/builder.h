// Turns the tree of objects into a Scene. One file per kind of object; this is what they share.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/sha256.h"
#include "formats/document/document.h"
#include "formats/document/kept.h"
#include "formats/document/plugins.h"
#include "formats/document/spectrum.h"
#include "formats/load.h"

namespace ambilux::document {

struct Builder {
    Builder(const Document& d, const LoadOptions& o, Vec3d p, Scene& s)
        : document(d), options(o), to_scene(translation(-p.x, -p.y, -p.z)), scene(s) {}

    const Document& document;
    const LoadOptions& options;
    Matrix to_scene;  ///< from the world of the file to that of the scene (Scene::origin)
    Scene& scene;
    bool validate_only = false;  ///< look at parameters only: nothing is read from images or added to the scene

    std::vector<std::pair<std::string, Sha256Digest>> file_digests;  ///< of meshes and images
    std::map<std::string, uint64_t> texel_pool;                      ///< file and decoding -> offset
    std::map<std::string, int32_t> texture_pool;                     ///< all settings -> texture
    std::map<std::string, LoadedImage> images;                       ///< by path and decoding
    std::vector<TextureFacts> texture_facts;                         ///< per texture
    std::map<const Object*, uint32_t> materials;
    uint32_t default_materials[2] = {kNone, kNone};  ///< of shapes without and with an emitter
    uint32_t null_materials[2] = {kNone, kNone};     ///< the same of BSDF null
    std::map<std::string, uint32_t> table_pool;      ///< contents' name -> offset in Scene::tables
    std::map<std::string, float> rough_reflectance_pool;
    std::set<std::string> reported;

    /// Textures of the mesh whose BSDF is being built, by the names of its attributes; null: none.
    const std::map<std::string, int32_t>* attribute_textures = nullptr;

    uint64_t memory = 0;  ///< of meshes and textures

    const Kept* before = nullptr;  ///< of the scene that this one is an edit of; null: none
    KeptGeometry geometry;
    std::map<const Object*, std::vector<Value>>* asked = nullptr;  ///< gets Kept::asked; null: nobody wants it

    /// Appends the table of that name, which may be that of the scene before; its place in Scene::tables.
    uint32_t add_table(const std::string& name, size_t size, const std::function<void(float*)>& make);

    /// Counts memory that the scene is going to have; Error(bad_input) with `path` if it is too much in all.
    void take_memory(uint64_t bytes, const std::string& path);

    /// Where fail_unless_moved() leaves its first error, for a scene that may yet be moved; null: it throws.
    std::optional<Error>* outside = nullptr;

    /// For what is wrong only so far from the origin. Safe to use from many threads.
    void fail_unless_moved(const Error& error) const;

    /// Fails unless all of these are in the range of the tracers (accel/range.h). `what` has them: "the shape".
    void check_range(const Where& where, const std::string& what, std::initializer_list<Vec3d> points) const;

    /// Document::resolve(), with a note where an included file has another one of that name beside it.
    std::string file(const std::string& name, const Where& where);

    /// Something we do in our own way, with the image that the file asks for; each text is said once.
    void note(const Where& where, const std::string& text);

    /// Something we cannot do: an error, or with --lenient a warning that says what is done instead.
    void refuse(const Where& where, const std::string& problem, const std::string& instead);

    /// Said once for each text: the image may be another than the file asks for, or none is right.
    void warn(const Where& where, const std::string& text);
};

/// Append to the scene; the index there.
uint32_t add_bsdf(Builder& builder, const BsdfRecord& bsdf);
uint32_t add_material(Builder& builder, const Material& material);

/// Appends bytes at the next multiple of 16.
uint64_t append_texels(Scene& scene, const void* data, size_t size);
/// Appends RGBA texels, as halves where that is allowed and loses nothing.
uint64_t append_floats(Scene& scene, const std::vector<float>& texels, bool allow_half, TexelFormat& format);
/// Puts the image's texels into the scene, once per file and decoding. `gamma` 0 takes what the file format implies;
/// `as_float` stores floats (environment maps), as halves where nothing is lost by that; alpha, which no one reads
/// there, is 1 then.
/// `channel` 0 to 3 puts that one of red, green, blue and alpha into all colours; alpha is linear.
/// `given`: of the document, not of a file.
/// `colors`: what is below 0 is 0 (note).
LoadedImage load_image(Builder& builder, const std::string& path, double gamma, bool as_float, bool colors,
                       int channel = -1, const Texels* given = nullptr);

/// A parameter that is not followed, and the values, "a|b", with which it needs not be.
struct LeftOut {
    const char* name;
    const char* done = "";
};

/// Reads the parameters of one object and keeps track of which were asked for.
class Reader {
public:
    Reader(Builder& builder, const Object& object) : builder_(builder), object_(object) {}

    const Object& object() const { return object_; }
    Where where() const { return object_.where; }
    [[noreturn]] void fail(const std::string& message) const;
    [[noreturn]] void fail(const Where& where, const std::string& message) const;

    bool has(const std::string& name) const { return find(name) || child_named(name); }
    /// Whether an object, a texture, gives the parameter.
    bool is_textured(const std::string& name) const { return child_named(name); }
    bool boolean(const std::string& name, bool fallback);
    int64_t integer(const std::string& name, int64_t fallback);
    double number(const std::string& name, double fallback);
    std::string text(const std::string& name, const std::string& fallback);
    Vec3d vector(const std::string& name, Vec3d fallback);
    Matrix transform(const std::string& name);
    /// Index of refraction: a number or a name.
    float ior(const std::string& name, const std::string& fallback);
    /// Where the parameter stands, or the object if it is absent.
    Where where(const std::string& name) const;

    Rgb color(const std::string& name, Rgb fallback, SpectrumUse use);
    ParamRgb textured_color(const std::string& name, Rgb fallback, SpectrumUse use);
    ParamFloat textured_number(const std::string& name, float fallback);

    /// Next nested object with this tag that nobody took yet, or null.
    const Object* take(const std::string& tag);
    /// The nested object of this name, or null.
    const Object* take_named(const std::string& name);
    /// Parameters that are known and change nothing here.
    void ignore(std::initializer_list<const char*> names);
    /// Parameters that ask for what is not done: a note says why.
    void leave(std::initializer_list<LeftOut> parameters, const std::string& why);
    /// Fails since there is no parameter `name`, or by the misspelled one that there is instead.
    [[noreturn]] void fail_without(const std::string& name, const std::string& message) const;
    /// Refuses what is left over.
    void finish();

private:
    /// Keeps what holds where the object says nothing of a parameter (Kept::asked).
    void keep(const std::string& name, ValueKind kind, const std::function<void(Value&)>& set) const;
    std::string unknown(const Value& value, const Plugins& known) const;
    ParamRgb checked_reflectance(const std::string& name, const Object& texture, const ParamRgb& parameter);
    const Value* value(const std::string& name, std::initializer_list<ValueKind> kinds, const char* expected);
    const Value* find(const std::string& name) const;
    const Child* child_named(const std::string& name) const;

    Builder& builder_;
    const Object& object_;
    std::set<const Value*> used_values_;
    mutable Plugins absent_;  ///< names that were asked for: a misspelled one is nearly one of these
    std::set<const Child*> used_children_;
    std::map<std::string, size_t> next_child_;  ///< by tag: where take() looks on
};

/// What a texture is read for.
enum class TextureUse { color, number, light, map };
/// Texture object as index into Scene::textures (0 when only validating).
int32_t load_texture(Builder& builder, const Object& object, TextureUse use = TextureUse::color);
/// Whether a texture takes its values from the mesh.
bool is_attribute(const Object& texture);
/// The texture that stands for an attribute of the mesh (Builder::attribute_textures).
int32_t attribute_texture(const Builder& builder, Reader& in);
/// A texture inside of textures of type `scale`, and their factors.
struct ScaledTexture {
    int32_t texture;
    Rgb scale;
};
ScaledTexture load_scaled_texture(Builder& builder, const Object& object, TextureUse use = TextureUse::color);
/// The image of the document that `in` names, or null.
const Texels* given_image(const Builder& builder, Reader& in);
/// Image as float texels without flip or decoding table, for the environment map `in`; and the largest of them.
/// `given`: of the document, not of a file.
int32_t load_environment_image(Builder& builder, Reader& in, const std::string& path, float& largest,
                               const Texels* given);
/// The same of RGBA texels that are at hand.
int32_t add_environment_image(Builder& builder, uint32_t width, uint32_t height, const std::vector<float>& texels);
/// Texture of float texels that bilinear lookups find at texel centres.
int32_t add_atlas(Builder& builder, uint32_t width, uint32_t height, const std::vector<float>& texels,
                  const TextureFacts& facts);
/// Texture of these RGBA texels with the size, coordinates, wrap mode and filter of `settings`.
int32_t add_baked_texture(Builder& builder, const Texture& settings, const std::vector<float>& texels,
                          const TextureFacts& facts);
/// Mean colour of a parameter over its texture.
Rgb mean_color(const Builder& builder, const ParamRgb& parameter);

/// BSDF object with its adapters as index into Scene::materials. `emits`: for a shape with an emitter.
uint32_t build_material(Builder& builder, const Object& bsdf, bool emits = false);
/// The same for one shape alone: with Builder::attribute_textures.
uint32_t build_own_material(Builder& builder, const Object& bsdf);
/// The material of the shape at `where`; without a BSDF it is diffuse, of reflectance 0.5, on emitters 0.
uint32_t shape_material(Builder& builder, const Object* bsdf, const Object* emitter, const Where& where);

/// All shapes, with their area emitters.
void build_shapes(Builder& builder, const Object& scene);
/// An emitter that is not part of a shape.
void build_emitter(Builder& builder, const Object& object);
/// An emitter that is part of a shape or not; of type `count` if none of these has that name.
Emitter read_emitter(Builder& builder, const Object& object, bool on_shape);

/// Emitters sky, sun and sunsky as environment maps. `rotation`: of the emitter.
bool is_sky(const std::string& type);
void read_sky(Builder& builder, Reader& in, const Matrix& rotation, Emitter& out);
/// Places an emitter.
void place(Emitter& e, const Matrix& to_world);

/// Tangent of half the field of view along x and y. Mitsuba's rule: `fov` with `fov_axis`, or `focal_length` in
/// millimetres on the diagonal of a 36 x 24 mm film.
Vec2f field_of_view(Reader& in, double aspect);
void build_sensor(Builder& builder, const Object& object);
/// The sensor, or of a batch of sensors the first one.
void build_sensors(Builder& builder, const Object& first);
/// For a scene that has none: it sees all shapes, as in Mitsuba 3.
void build_default_sensor(Builder& builder, const Object& scene);
void build_integrator(Builder& builder, const Object& object);

/// Rotation and translation of `m` without scale, its axes made exactly orthonormal; `problem` is set if `m` scales or
/// shears.
Matrix rigid_part(const Matrix& m, bool& problem);

}  // namespace ambilux::document
