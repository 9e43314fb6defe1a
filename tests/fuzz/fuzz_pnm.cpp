#include "formats/images/readers.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    FileBudget budget("input", limits());
    if (is_pnm(bytes)) read_pnm(bytes, budget);
    if (is_pfm(bytes)) read_pfm(bytes, budget);
}
