#include "backends/cpu/primitives.h"

#include <tbb/parallel_scan.h>
#include <tbb/parallel_sort.h>

#include <array>

#include "core/parallel.h"

namespace ambilux {
namespace {

/// Two words of a pair with its place before the sort, so that no two are equal and any sort is stable.
struct Placed {
    uint64_t key;
    uint32_t value, place;
};

template <class Key>
Key low_bits(uint32_t bits) {
    return bits >= 8 * sizeof(Key) ? Key(~Key(0)) : Key((Key(1) << bits) - 1);
}

}  // namespace

PrimitiveBytes host_primitive_bytes() {
    return {[](uint32_t items, uint32_t) { return uint64_t(items) * sizeof(Placed); },
            [](uint32_t) { return uint64_t(0); }};
}

template <class Key>
void sort_pairs_alone(const SortMemory<Key>& m, uint32_t items, uint32_t bits) {
    constexpr uint32_t kDigit = 8, kDigits = 1u << kDigit;
    auto* const spare = reinterpret_cast<Placed*>(m.temporary);
    // Digit after digit from the lowest on, between [1] and the temporary memory; pairs end in [1].
    for (uint32_t i = 0; i < items; ++i) m.keys[1][i] = m.keys[0][i], m.values[1][i] = m.values[0][i];
    for (uint32_t shift = 0; shift < bits; shift += kDigit) {
        const Key mask = Key(low_bits<Key>(bits) >> shift) & Key(kDigits - 1);
        std::array<uint32_t, kDigits + 1> first{};
        for (uint32_t i = 0; i < items; ++i) ++first[size_t(m.keys[1][i] >> shift & mask) + 1];
        for (uint32_t d = 0; d < kDigits; ++d) first[d + 1] += first[d];
        for (uint32_t i = 0; i < items; ++i)
            spare[first[size_t(m.keys[1][i] >> shift & mask)]++] = {m.keys[1][i], m.values[1][i], 0};
        for (uint32_t i = 0; i < items; ++i) m.keys[1][i] = Key(spare[i].key), m.values[1][i] = spare[i].value;
    }
}

template <class Key>
void sort_pairs_together(const SortMemory<Key>& m, uint32_t items, uint32_t bits) {
    auto* const placed = reinterpret_cast<Placed*>(m.temporary);
    const Key mask = low_bits<Key>(bits);
    parallel_for(items, [&](uint32_t i) { placed[i] = {m.keys[0][i], m.values[0][i], i}; }, 4096u);
    tbb::parallel_sort(placed, placed + items, [mask](const Placed& a, const Placed& b) {
        const Key x = Key(a.key) & mask, y = Key(b.key) & mask;
        return x != y ? x < y : a.place < b.place;
    });
    parallel_for(
        items, [&](uint32_t i) { m.keys[1][i] = Key(placed[i].key), m.values[1][i] = placed[i].value; }, 4096u);
}

void scan_together(const uint32_t* in, uint32_t* out, uint32_t items) {
    tbb::parallel_scan(
        tbb::blocked_range<uint32_t>(0, items, 4096), uint32_t(0),
        [&](const tbb::blocked_range<uint32_t>& range, uint32_t sum, bool last) {
            for (uint32_t i = range.begin(); i != range.end(); ++i) {
                const uint32_t value = in[i];
                if (last) out[i] = sum;
                sum += value;
            }
            return sum;
        },
        [](uint32_t a, uint32_t b) { return a + b; });
}

template void sort_pairs_alone(const SortMemory<uint16_t>&, uint32_t, uint32_t);
template void sort_pairs_alone(const SortMemory<uint32_t>&, uint32_t, uint32_t);
template void sort_pairs_alone(const SortMemory<uint64_t>&, uint32_t, uint32_t);
template void sort_pairs_together(const SortMemory<uint16_t>&, uint32_t, uint32_t);
template void sort_pairs_together(const SortMemory<uint32_t>&, uint32_t, uint32_t);
template void sort_pairs_together(const SortMemory<uint64_t>&, uint32_t, uint32_t);

}  // namespace ambilux
