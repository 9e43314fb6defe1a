// Which of a build's kernels a device gets: machine code, or PTX that the driver compiles for it. A compute capability
// is a number: 86 is 8.6.
#pragma once

#include <string>
#include <vector>

namespace ambilux {

/// What a build has kernels for.
struct BuiltFor {
    std::vector<int> machine_code, ptx;
};

/// From a list as CMake's CUDA_ARCHITECTURES is, separated by commas: "80-real,90" has machine code of 8.0 and 9.0, and
/// PTX of 9.0. Words that are no numbers are left out.
BuiltFor built_for(const std::string& architectures);

enum class KernelKind { none, ptx, machine_code };
struct KernelChoice {
    KernelKind kind = KernelKind::none;
    int of = 0;

    bool operator==(const KernelChoice&) const = default;
};

/// Machine code runs on devices of the same major number and no smaller minor one, PTX on all that are no older (CUDA
/// C++ Programming Guide, "Binary Compatibility" and "PTX Compatibility"). `force_ptx`: CUDA_FORCE_PTX_JIT=1.
KernelChoice kernels_for(int capability, const BuiltFor& built, bool force_ptx);

/// "8.6".
std::string capability_text(int capability);
/// "machine code of 8.0", "PTX of 8.0", "none".
std::string kernels_text(const KernelChoice& kernels);
/// "machine code of 8.0, 9.0 and PTX of 8.0".
std::string built_text(const BuiltFor& built);

}  // namespace ambilux
