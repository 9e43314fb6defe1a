#include "session/state.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    const InputFile file(bytes);
    read_state(file.path());
}
