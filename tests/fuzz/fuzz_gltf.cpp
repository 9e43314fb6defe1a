#include "formats/gltf/load.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    const InputFile file(bytes);
    LoadOptions options;
    options.limits = limits();
    options.lenient = !bytes.empty() && bytes.back() == ' ';
    options.width = options.height = 8;
    load_gltf(file.path(), options);
}
