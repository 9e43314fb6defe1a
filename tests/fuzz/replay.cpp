// A fuzz target without libFuzzer: every seed of a folder, and a few edits of each by fixed random numbers, so that a
// build with any compiler shows that targets compile and that what they read ends in a result or an error. Exit status
// 2 without seeds.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <random>
#include <vector>

#include "core/atomic_file.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

constexpr int kEdits = 32;  ///< of a seed

void run(const std::string& input) {
    LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(input.data()), input.size());
}

/// One to four times: another byte, a part erased, a part repeated, or the rest cut off.
std::string edited(std::string input, std::minstd_rand& random) {
    for (uint32_t k = 1 + uint32_t(random() % 4); k > 0 && !input.empty(); --k) {
        const size_t at = random() % input.size(), length = std::min<size_t>(1 + random() % 16, input.size() - at);
        switch (random() % 4) {
            case 0: input[at] = char(random() % 256); break;
            case 1: input.erase(at, length); break;
            case 2: input.insert(at, input.substr(at, length)); break;
            default: input.resize(at);
        }
    }
    return input;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return 2;
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(argv[1]))
        if (entry.is_regular_file()) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    std::minstd_rand random(1);
    for (const auto& file : files) {
        const std::string seed = ambilux::read_file(file.string());
        run(seed);
        for (int k = 0; k < kEdits; ++k) run(edited(seed, random));
    }
    std::printf("%zu seeds, %zu inputs\n", files.size(), files.size() * (kEdits + 1));
    return files.empty() ? 2 : 0;
}
