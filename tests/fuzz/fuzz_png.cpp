#include "formats/images/readers.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    FileBudget budget("input", limits());
    if (is_png(bytes)) read_png(bytes, budget);
}
