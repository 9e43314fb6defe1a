// What a scene was built of, so that one that differs by edits takes over what is the same.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "formats/document/document.h"
#include "scene/primitive_bounds.h"

namespace ambilux::document {

/// Of the colours of a texture.
struct TextureFacts {
    Rgb mean{}, largest{};
    std::string file;  ///< that they come from
};

/// Size and place of an image whose texels are in the scene.
struct LoadedImage {
    uint32_t width = 0, height = 0;
    uint64_t offset = 0;
    TexelFormat format = TexelFormat::rgba8;
    uint32_t decode_table = 0;
    TextureFacts facts;
    double gamma = 1;
    uint64_t memory = 0;    ///< Builder::take_memory
    Sha256Digest digest{};  ///< of its file
    std::vector<std::string> notes;

    uint64_t bytes() const { return uint64_t(width) * height * bytes_of_texel(format); }
};

/// What triangles and analytic shapes were made of. Materials and emitters are no part of it.
struct KeptGeometry {
    std::vector<std::string>
        keys;  ///< of the shapes of the document: all that their primitives depend on; none: unknown
    std::vector<uint32_t> of_shape;  ///< for each Scene::shapes: whose copy it is
    std::vector<std::pair<std::string, Sha256Digest>> digests;
    std::vector<std::string> warnings, notes;
    uint64_t memory = 0;
    Bounds3f surfaces;
};

struct Kept {
    Scene scene;                                    ///< finished; shares its arrays
    std::map<std::string, LoadedImage> images;      ///< Builder::images
    std::map<std::string, uint32_t> table_pool;     ///< Builder::table_pool
    std::map<std::string, float> reflectance_pool;  ///< Builder::rough_reflectance_pool
    KeptGeometry geometry;
    std::map<const Object*, std::vector<Value>>
        asked;  ///< what readers asked for, with what held where nothing is said
};

}  // namespace ambilux::document
