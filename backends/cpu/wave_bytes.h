// Host memory of a wave, aligned as queues want it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>

namespace ambilux {

namespace detail {

struct WaveBytesDelete {
    void operator()(std::byte* p) const { ::operator delete[](p, std::align_val_t(256)); }
};

}  // namespace detail

using WaveBytes = std::unique_ptr<std::byte, detail::WaveBytesDelete>;

/// `size` bytes of zeros.
inline WaveBytes make_wave_bytes(uint64_t size) {
    WaveBytes bytes(static_cast<std::byte*>(::operator new[](size, std::align_val_t(256))));
    std::fill_n(bytes.get(), size, std::byte{0});
    return bytes;
}

}  // namespace ambilux
