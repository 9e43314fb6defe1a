// What sorts and scans are tested with, on a host and on a device: their memory, byte by byte, before and after.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <numeric>
#include <string>
#include <vector>

#include "queues/primitives.h"

namespace ambilux::test {

/// Numbers that depend on nothing but `i`.
inline uint32_t scrambled(uint32_t i) {
    i = (i ^ i >> 16) * 0x7feb352du;
    i = (i ^ i >> 15) * 0x846ca68bu;
    return i ^ i >> 16;
}

/// `n` keys, random in all of their bits.
template <class Key>
std::vector<Key> scrambled_keys(uint32_t n) {
    std::vector<Key> keys(n);
    for (uint32_t i = 0; i < n; ++i) keys[i] = Key(uint64_t(scrambled(2 * i)) << 32 | scrambled(2 * i + 1));
    return keys;
}

/// A sort of the first pairs of more, by the lowest bits of their keys. Values are numbers that no two pairs share.
template <class Key>
struct SortCase {
    std::vector<Key> keys;
    uint32_t bits;
    PrimitiveBytes primitives;
    uint32_t capacity = uint32_t(keys.size()) + 5;

    uint32_t size() const { return uint32_t(keys.size()); }
    Key sorted_by(uint32_t i) const { return bits < 8 * sizeof(Key) ? Key(keys[i] & ((Key(1) << bits) - 1)) : keys[i]; }
    static uint32_t value(uint32_t i) { return 3 * i + 7; }

    uint64_t bytes() const {
        Layout dry;
        lay_out(dry);
        return dry.bytes();
    }
    /// The same places in any memory.
    SortMemory<Key> place(void* memory) const {
        Layout dry;
        lay_out(dry);
        Layout placed(dry, memory);
        return lay_out(placed);
    }

    /// All bytes before the sort.
    std::vector<std::byte> before() const {
        std::vector<std::byte> image(bytes(), std::byte(0xa5));
        const SortMemory<Key> m = place(image.data());
        for (uint32_t i = 0; i < size(); ++i) m.keys[0][i] = keys[i], m.values[0][i] = value(i);
        return image;
    }
    /// All bytes after it, but for temporary ones: those of before, with what std::stable_sort makes of the pairs.
    std::vector<std::byte> after() const {
        std::vector<std::byte> image = before();
        std::vector<uint32_t> order(size());
        std::iota(order.begin(), order.end(), 0u);
        std::stable_sort(order.begin(), order.end(),
                         [this](uint32_t a, uint32_t b) { return sorted_by(a) < sorted_by(b); });
        const SortMemory<Key> m = place(image.data());
        for (uint32_t i = 0; i < size(); ++i) m.keys[1][i] = keys[order[i]], m.values[1][i] = value(order[i]);
        return image;
    }
    /// Whether a sort has made `image` what it should be, and touched nothing else. `padded`: pairs past the last have
    /// been sorted too.
    bool sorted(std::vector<std::byte> image, bool padded = false) const {
        std::vector<std::byte> expected = after();
        for (std::vector<std::byte>* bytes : {&image, &expected}) {
            const SortMemory<Key> m = place(bytes->data());
            std::fill_n(m.temporary, m.temporary_bytes, std::byte(0));
            for (uint32_t i = size(); padded && i < capacity; ++i)
                m.keys[0][i] = m.keys[1][i] = 0, m.values[0][i] = m.values[1][i] = 0;
        }
        return image == expected;
    }

private:
    SortMemory<Key> lay_out(Layout& layout) const {
        const SortMemory<Key> m = SortMemory<Key>::lay_out(layout, capacity, primitives);
        layout.allocate<std::byte>(256);  // past the end
        return m;
    }
};

/// Calls each(what, case) for keys in many orders: random, with many ties, all the same, sorted, reversed, all bits
/// set.
template <class Key, class Each>
void for_sort_cases(uint32_t n, const PrimitiveBytes& primitives, const Each& each) {
    constexpr uint32_t kBits = 8 * sizeof(Key);
    const std::vector<Key> random = scrambled_keys<Key>(n);
    const auto sort = [&](const std::string& what, const std::vector<Key>& keys, uint32_t bits) {
        each(std::to_string(n) + " keys of " + std::to_string(kBits) + " bits, sorted by " + std::to_string(bits) +
                 ", " + what,
             SortCase<Key>{keys, bits, primitives});
    };
    for (const uint32_t bits : {1u, 3u, 8u, 9u, kBits - 1, kBits}) sort("random", random, bits);
    sort("all the same", std::vector<Key>(n, Key(0x1234)), kBits);
    sort("all bits set", std::vector<Key>(n, Key(~Key(0))), kBits);
    std::vector<Key> sorted = random;
    std::sort(sorted.begin(), sorted.end());
    sort("sorted", sorted, kBits);
    std::reverse(sorted.begin(), sorted.end());
    sort("reversed", sorted, kBits);
}

/// Numbers whose sum goes past 32 bits where there are many.
inline std::vector<uint32_t> numbers_to_sum(uint32_t n) {
    std::vector<uint32_t> numbers(n);
    for (uint32_t i = 0; i < n; ++i) numbers[i] = scrambled(i) >> i % 30;
    return numbers;
}
inline std::vector<uint32_t> sums_before(const std::vector<uint32_t>& numbers) {
    std::vector<uint32_t> sums(numbers.size());
    std::exclusive_scan(numbers.begin(), numbers.end(), sums.begin(), 0u);
    return sums;
}

}  // namespace ambilux::test
