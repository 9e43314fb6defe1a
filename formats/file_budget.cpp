#include "formats/file_budget.h"

#include "core/atomic_file.h"
#include "core/error.h"

namespace ambilux {

FileBudget::FileBudget(std::string path, const Limits& limits)
    : path_(std::move(path)), limits_(limits), start_(std::chrono::steady_clock::now()) {}

void FileBudget::fail(const std::string& message, int line) const { throw input_error(path_, line, message); }

void FileBudget::pixels(uint64_t width, uint64_t height) const {
    if (width == 0 || height == 0)
        fail("the image has no pixels: its size is " + std::to_string(width) + "x" + std::to_string(height));
    if (height > limits_.pixels / width)
        fail("an image of " + std::to_string(width) + "x" + std::to_string(height) +
             " pixels is larger than --limits pixels=" + std::to_string(limits_.pixels));
}

void FileBudget::bytes(uint64_t count, uint64_t size) const {
    if (size > 0 && count > limits_.bytes / size)
        fail("its content takes more memory than --limits bytes=" + std::to_string(limits_.bytes));
}

bool FileBudget::expired() const {
    return std::chrono::steady_clock::now() - start_ > std::chrono::seconds(limits_.seconds);
}

void FileBudget::check_time() const {
    if (expired()) fail("reading it takes longer than --limits seconds=" + std::to_string(limits_.seconds));
}

std::string read_input(const std::string& path, const Limits& limits) { return read_file(path, limits.bytes); }

}  // namespace ambilux
