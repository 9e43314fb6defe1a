// What every fuzz target is: a function of the bytes that libFuzzer makes. Errors are what is expected of bad input;
// everything else that is thrown, and what the sanitizers find, is a finding.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/log.h"
#include "formats/load.h"

namespace ambilux::fuzz {

/// Small enough that a run takes no time.
inline Limits limits() {
    Limits l;
    l.pixels = 1 << 18;
    l.bytes = 1 << 24;
    l.total_bytes = 1 << 26;
    l.shapes = 1000;
    l.includes = 20;
    l.expansion = 1 << 16;
    l.seconds = 5;
    return l;
}

/// A small film; lenient where the input ends with a space.
inline LoadOptions scene_options(std::string_view bytes) {
    LoadOptions options;
    options.limits = limits();
    options.lenient = !bytes.empty() && bytes.back() == ' ';
    options.width = options.height = 8;
    return options;
}

/// The input as a file, for readers that take a name.
class InputFile {
public:
    explicit InputFile(std::string_view bytes) : fd_(::memfd_create("input", MFD_CLOEXEC)) {
        while (!bytes.empty()) {
            const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
            if (n <= 0) break;
            bytes.remove_prefix(size_t(n));
        }
    }
    ~InputFile() { ::close(fd_); }
    InputFile(const InputFile&) = delete;

    std::string path() const { return "/proc/self/fd/" + std::to_string(fd_); }

private:
    int fd_;
};

/// Defined by each target.
void read(std::string_view bytes);

}  // namespace ambilux::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    ambilux::set_quiet(true);
    try {
        ambilux::fuzz::read({reinterpret_cast<const char*>(data), size});
    } catch (const ambilux::Error&) {}
    return 0;
}
