// What a scene and its files may ask for: generous for real scenes, a bound for hostile ones (docs/limits.md).
#pragma once

#include <cstdint>
#include <string>

namespace ambilux {

struct Limits {
    uint64_t pixels = 1ull << 28;        ///< of one image
    uint64_t bytes = 4ull << 30;         ///< of one file, and of what it becomes in memory
    uint64_t total_bytes = 64ull << 30;  ///< of all meshes and textures of a scene in memory
    uint64_t shapes = 1ull << 24;        ///< of a scene, instances counted one by one
    uint64_t copies = 256 << 10;         ///< triangles of all copies of one group; instances of larger ones share them
    uint64_t includes = 1000;            ///< of all XML files of a scene, folders of <path> counted too
    uint64_t expansion = 64ull << 20;    ///< characters that the $parameters of a scene expand to
    uint64_t nesting = 256;              ///< elements in elements, files in files, references in references
    uint64_t seconds = 600;              ///< for reading one file
};

/// Sets one from "KEY=VALUE"; values may end in K, M or G (powers of 1024). Throws Error(usage).
void set_limit(Limits& limits, const std::string& assignment);

/// "pixels=268435456, ...": keys with their values.
std::string limits_text(const Limits& limits);

}  // namespace ambilux
