// Scene files: text and bytes in, a finished scene out.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "formats/finalize.h"
#include "formats/limits.h"

namespace ambilux {

struct Mesh;
struct Texels;

/// Where loading spends its time, in seconds of the wall clock.
struct LoadTimes {
    double read = 0;    ///< files: text, meshes and images, with their fingerprints and checks
    double place = 0;   ///< shapes, materials and emitters of what was read, in the coordinates of the scene
    double finish = 0;  ///< finalize_scene(): areas, bounds and tables
};

namespace document {
struct Document;
struct Kept;
}  // namespace document

/// What a scene was made of, from which edits start (formats/edits.h).
struct Editable {
    std::shared_ptr<const document::Document> document;
    std::shared_ptr<const document::Kept> kept;
};

/// A change of a scene by name, such as lamp.radiance (docs/python.md): to a text as an attribute of a scene file holds
/// it ("0.2", "1 0 0"), to an element of Mitsuba's XML, or to an array. Nothing: what holds where the file says
/// nothing.
struct Edit {
    std::string name, text;
    std::shared_ptr<const Mesh> mesh;
    std::shared_ptr<const Texels> image;
};

/// Options of the loader.
struct LoadOptions {
    bool lenient = false;            ///< replace what is not known, and list each substitution, instead of refusing it
    uint32_t width = 0, height = 0;  ///< nonzero: replaces the film size (a crop is scaled with it)
    LightPicking light_picking = LightPicking::power;
    std::vector<std::pair<std::string, std::string>> parameters;  ///< values of $parameters, over the file's defaults
    Limits limits;
    std::vector<std::string>* files = nullptr;  ///< gets the names of all files that were read
    LoadTimes* times = nullptr;                 ///< how long the parts took is added
    std::vector<Edit> edits;
    Editable* editable = nullptr;  ///< gets what edits of this scene start from
};

/// Loads a scene of any format, by the ending of the file: .pbrt and .pbrt.gz (pbrt-v4), .gltf and .glb (glTF 2.0),
/// else Mitsuba XML. Throws Error(bad_input) with file and line.
Scene load_scene_file(const std::string& path, const LoadOptions& options = {});

/// Loads a Mitsuba XML scene (formats 0.5, 0.6, 2.x and 3.x). Throws Error(bad_input) with file and line.
Scene load_mitsuba(const std::string& path, const LoadOptions& options = {});

/// Loads a scene of pbrt-v4. Throws Error(bad_input) with file and line.
Scene load_pbrt(const std::string& path, const LoadOptions& options = {});

/// Loads a scene of glTF 2.0 from a .gltf or .glb file. Throws Error(bad_input) that names the file and the part of it.
Scene load_gltf(const std::string& path, const LoadOptions& options = {});

/// The same as load_mitsuba of a text, as if it stood in a file at `path`: that is where the files that it names are
/// looked for.
Scene load_mitsuba_text(const std::string& text, const std::string& path, const LoadOptions& options = {});

}  // namespace ambilux
