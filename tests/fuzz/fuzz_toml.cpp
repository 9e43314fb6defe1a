#include "experiments/config.h"
#include "tests/fuzz/target.h"

void ambilux::fuzz::read(std::string_view bytes) {
    const InputFile file(bytes);
    resolved_toml(read_experiment(file.path()));
}
