// Mitsuba's XML as a tree of objects: includes, parameters, search folders, aliases and references are resolved; names
// are in the snake_case of format 2 and later.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/vec.h"
#include "formats/limits.h"
#include "formats/mitsuba/transform.h"

namespace ambilux::mitsuba {

/// Where something stands in the input.
struct Where {
    std::string file;
    int line = 0;
};

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
    std::vector<std::string> search_folders;                 ///< of <path>, in order
    std::vector<std::pair<std::string, std::string>> files;  ///< path and text of the XML files read
    Limits limits;

    /// Path of a file named in `where.file`: relative to that file's folder, then to the <path> folders, then to the
    /// main file's. Throws Error(bad_input) if there is none.
    std::string resolve(const std::string& name, const Where& where) const;
};

/// Parses the file, or `text` as if the file held it. `parameters` replace <default>s; one that the file does not use
/// is an error. Throws Error(bad_input) with file and line.
Document parse_document(const std::string& path, const std::vector<std::pair<std::string, std::string>>& parameters,
                        const Limits& limits = {}, const std::string* text = nullptr);

}  // namespace ambilux::mitsuba
