// Memory that is kept for later.
#pragma once

#include <cstddef>
#include <memory>

namespace ambilux {

/// Holds memory from now on, so that what is released before a save is there for it. Throws std::bad_alloc now, not
/// after hours of work.
class MemoryReserve {
public:
    explicit MemoryReserve(size_t bytes) : bytes_(std::make_unique<char[]>(bytes)) {}  // all zeros: really there
    void release() { bytes_.reset(); }

private:
    std::unique_ptr<char[]> bytes_;
};

}  // namespace ambilux
