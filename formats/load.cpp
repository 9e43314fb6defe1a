#include "formats/load.h"

#include <filesystem>

#include "core/error.h"

namespace ambilux {

namespace {

bool ends_with(const std::string& path, std::string_view ending) {
    if (path.size() < ending.size()) return false;
    for (size_t i = 0; i < ending.size(); ++i) {
        const char c = path[path.size() - ending.size() + i];
        if ((c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c) != ending[i]) return false;
    }
    return true;
}

}  // namespace

Scene load_scene_file(const std::string& path, const LoadOptions& options) {
    std::error_code ignored;  // the reader says of it
    if (std::filesystem::is_directory(path, ignored))
        throw input_error(path, 0, "it is a folder: name the scene's file in it");
    const bool pbrt = ends_with(path, ".pbrt") || ends_with(path, ".pbrt.gz");
    const bool gltf = ends_with(path, ".gltf") || ends_with(path, ".glb");
    if (!pbrt && !gltf) return load_mitsuba(path, options);
    if (!options.parameters.empty())
        throw input_error(path, 0, "the scene has no parameter '$" + options.parameters[0].first + "'");
    return pbrt ? load_pbrt(path, options) : load_gltf(path, options);
}

}  // namespace ambilux
