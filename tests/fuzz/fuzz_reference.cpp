#include "film/exr_io.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    // Larger images are allowed there, and would only take time.
    if (bytes.size() > 1 << 16) return;
    const InputFile file(bytes);
    Attributes attributes;
    read_reference_exr(file.path(), &attributes);
}
