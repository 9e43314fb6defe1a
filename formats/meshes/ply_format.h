// What the header of a PLY file declares.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace ambilux::ply {

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, float32, float64 };
enum class Encoding { ascii, little_endian, big_endian };

/// What a property of the vertex element means to us.
enum class Role { skip, x, y, z, nx, ny, nz, u, v };

struct Property {
    std::string name;
    Scalar type;
    bool list = false;
    Scalar count_type = Scalar::uint8;
    Role role = Role::skip;
    int attribute = -1;    ///< place in Mesh::attributes
    uint32_t channel = 0;  ///< of it
};

struct Element {
    std::string name;
    uint64_t count = 0;
    std::vector<Property> properties;
};

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
