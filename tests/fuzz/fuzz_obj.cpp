#include "formats/meshes/mesh.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) { read_obj("input", bytes, true, limits()); }
