#include "formats/meshes/mesh.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    for (const int index : {0, 1}) read_serialized("input", bytes, index, false, limits());
}
