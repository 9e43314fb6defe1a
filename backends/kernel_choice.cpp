#include "backends/kernel_choice.h"

#include <algorithm>
#include <cstdlib>
#include <sstream>

namespace ambilux {
namespace {

std::string list_text(const std::vector<int>& capabilities) {
    std::string text;
    for (const int c : capabilities) text += (text.empty() ? "" : ", ") + capability_text(c);
    return text.empty() ? "none" : text;
}

}  // namespace

BuiltFor built_for(const std::string& architectures) {
    BuiltFor built;
    std::istringstream words(architectures);
    for (std::string word; std::getline(words, word, ',');) {
        const int capability = std::atoi(word.c_str());
        if (capability <= 0) continue;
        if (!word.ends_with("-virtual")) built.machine_code.push_back(capability);
        if (!word.ends_with("-real")) built.ptx.push_back(capability);
    }
    return built;
}

KernelChoice kernels_for(int capability, const BuiltFor& built, bool force_ptx) {
    KernelChoice best;
    const auto take_larger = [&](KernelKind kind, int of) {
        if (best.kind != kind || of > best.of) best = {kind, of};
    };
    for (const int c : built.ptx)
        if (c <= capability) take_larger(KernelKind::ptx, c);
    if (force_ptx) return best;
    for (const int c : built.machine_code)
        if (c / 10 == capability / 10 && c <= capability) take_larger(KernelKind::machine_code, c);
    return best;
}

std::string capability_text(int capability) {
    return std::to_string(capability / 10) + "." + std::to_string(capability % 10);
}

std::string kernels_text(const KernelChoice& kernels) {
    if (kernels.kind == KernelKind::none) return "none";
    return (kernels.kind == KernelKind::ptx ? "PTX of " : "machine code of ") + capability_text(kernels.of);
}

std::string built_text(const BuiltFor& built) {
    if (built.machine_code.empty() && built.ptx.empty()) return "none";
    return "machine code of " + list_text(built.machine_code) + " and PTX of " + list_text(built.ptx);
}

}  // namespace ambilux
