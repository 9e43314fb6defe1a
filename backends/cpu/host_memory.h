// Memory of films, states and waves on a host.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>

namespace ambilux {

namespace detail {

constexpr std::align_val_t kHostAlignment{256};

struct HostMemoryDelete {
    void operator()(std::byte* p) const { ::operator delete[](p, kHostAlignment); }
};

}  // namespace detail

/// Bytes that are zero at first, aligned as queues want them. Backends have the same functions for theirs
/// (DeviceMemory).
class HostMemory {
public:
    HostMemory() = default;
    /// Throws std::bad_alloc. `what` is for messages of other kinds of memory.
    explicit HostMemory(uint64_t bytes, const char* = "")
        : bytes_(bytes), data_(static_cast<std::byte*>(::operator new[](bytes, detail::kHostAlignment))) {
        std::fill_n(data_.get(), bytes, std::byte{0});
    }

    std::byte* data() { return data_.get(); }
    uint64_t bytes() const { return bytes_; }

    /// From the host to this kind of memory, back, and within it.
    static void put(void* to, const void* from, uint64_t bytes) { copy(to, from, bytes); }
    static void get(void* to, const void* from, uint64_t bytes) { copy(to, from, bytes); }
    static void copy(void* to, const void* from, uint64_t bytes) {
        if (bytes > 0) std::memcpy(to, from, bytes);
    }
    static void clear(void* to, uint64_t bytes) {
        if (bytes > 0) std::memset(to, 0, bytes);
    }

private:
    uint64_t bytes_ = 0;
    std::unique_ptr<std::byte, detail::HostMemoryDelete> data_;
};

}  // namespace ambilux
