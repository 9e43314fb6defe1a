// What the header of a PLY file declares.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace ambilux::ply {

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
enum class Encoding { ascii, little_endian, big_endian };

/// What a property means to us: of vertices, `corners` of faces and strips, and two numbers for each of these.
enum class Role { skip, x, y, z, nx, ny, nz, u, v, corners, corner_uvs };

struct Property {
    std::string name;
    Scalar type;
    bool list = false;
    Scalar count_type = Scalar::uint8;
    Role role = Role::skip;
    std::string attribute_name;  ///< as MeshAttribute has it; may be empty
    uint32_t channel = 0;        ///< of it
    int attribute = -1;          ///< place in Mesh::attributes
};

struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;
};

struct Header {
    Encoding encoding = Encoding::ascii;
    std::vector<Element> elements;
    size_t size = 0;  ///< in bytes
    int lines = 0;
};

/// The header at the beginning of a file, with the roles of its properties by the names that programs give them.
Header read_header(const std::string& path, std::string_view bytes);

inline bool has_role(const Element& element, Role role) {
    for (const Property& p : element.properties)
        if (p.role == role) return true;
    return false;
}

inline size_t size_of(Scalar type) {
    switch (type) {
        case Scalar::int8:
        case Scalar::uint8: return 1;
        case Scalar::int16:
        case Scalar::uint16: return 2;
        case Scalar::float64: return 8;
        default: return 4;
    }
}

}  // namespace ambilux::ply
