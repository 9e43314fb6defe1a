#include "formats/meshes/mesh.h"
#include "tests/fuzz/target.h"

// With attributes and without: both ways are looked for.
void ambilux::fuzz::read(std::string_view bytes) {
    const std::set<std::string> colors = {"vertex_color", "face_color"};
    read_ply("input", bytes, true, limits(), bytes.size() % 2 ? std::set<std::string>{} : colors);
}
