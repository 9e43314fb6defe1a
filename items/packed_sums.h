// The sums of a subpath (Mis::Sums) as items keep them: word by word. Sums are plain words, floats or what their author
// packs into a word, in the order in which they are declared.
#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>

#include "core/hd.h"

namespace ambilux {

/// Words of the sums that a ray keeps.
template <class Sums>
constexpr uint32_t ray_words() {
    static_assert(std::is_trivially_copyable_v<Sums> && sizeof(Sums) % sizeof(float) == 0, "sums are plain words");
    return sizeof(Sums) / sizeof(float);
}
/// The first words, those that a vertex keeps: all, or Sums::kVertexWords.
template <class Sums>
constexpr uint32_t vertex_words() {
    if constexpr (requires { Sums::kVertexWords; })
        return Sums::kVertexWords;
    else
        return ray_words<Sums>();
}

/// Words of sums that rays carry from their second one on: their first ray has what it starts with in the place of the
/// others, Sums::kFirstRayWords.
template <class Sums>
constexpr uint32_t later_ray_words() {
    if constexpr (requires { Sums::kFirstRayWords; })
        return ray_words<Sums>() - Sums::kFirstRayWords;
    else
        return 0;
}

/// Whole lanes for words that have no place of their own in an item.
template <uint32_t kWords>
struct SumLanes {
    static constexpr uint32_t kLanes = (kWords + 3) / 4;
    float word[kLanes * 4];
};
template <>
struct SumLanes<0> {
    static constexpr uint32_t kLanes = 0;
    float word[0];  // no size: nvcc loses what follows a member without an address of its own when it copies
};

/// The first `kWords` words of sums, of which an item has places for `kPlaces`. Places without a word are 0.
template <uint32_t kPlaces, uint32_t kWords>
struct PackedSums {
    using More = SumLanes<(kWords > kPlaces ? kWords - kPlaces : 0)>;

    float word[kPlaces];
    More more;

    template <class Sums>
    AMBILUX_HD static PackedSums pack(const Sums& sums) {
        PackedSums packed = {};
        memcpy(&packed, &sums, kWords * sizeof(float));
        return packed;
    }
    /// Words that were not kept are 0.
    template <class Sums>
    AMBILUX_HD Sums unpack() const {
        Sums sums = {};
        memcpy(&sums, this, kWords * sizeof(float));
        return sums;
    }
};

}  // namespace ambilux
