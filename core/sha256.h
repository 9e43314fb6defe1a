// SHA-256 (FIPS 180-4), for fingerprints of input files.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace ambilux {

using Sha256Digest = std::array<uint8_t, 32>;

/// Running hash: update() any number of times, then digest() once.
struct Sha256 {
    uint32_t state[8] = {0x6a09e667u, 0xbb67ae85u, 0x3c6ef372u, 0xa54ff53au,
                         0x510e527fu, 0x9b05688cu, 0x1f83d9abu, 0x5be0cd19u};
    uint8_t block[64] = {};
    uint64_t bytes = 0;

    void update(const void* data, size_t size);
    void update(std::string_view text) { update(text.data(), text.size()); }
    Sha256Digest digest();
};

/// Digest of one buffer.
Sha256Digest sha256(std::string_view bytes);

/// Lower-case hexadecimal, 64 characters.
std::string to_hex(const Sha256Digest& digest);

}  // namespace ambilux
