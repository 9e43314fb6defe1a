#include "formats/meshes/mesh.h"
#include "tests/fuzz/target.h"

// With colours and without: both ways are looked for.
void ambilux::fuzz::read(std::string_view bytes) {
    read_obj("input", bytes, true, limits(),
             bytes.size() % 2 ? std::set<std::string>{} : std::set<std::string>{"vertex_color"});
}
