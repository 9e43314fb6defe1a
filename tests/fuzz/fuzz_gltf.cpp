#include "formats/load.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    const InputFile file(bytes);
    load_gltf(file.path(), scene_options(bytes));
}
