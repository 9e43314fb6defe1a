// Loops that GCC makes vectors of, of 16 floats with AVX-512 and else of 8 with AVX2, because all that they call is
// inlined, early returns included, whose conditions it joins. What it needs for that: the options in
// render/CMakeLists.txt; a function around the body, whose locals are not those of the loop; structs that are not const
// where parts of them are copied; no bool that is one of two bools.
#pragma once

#include "core/math.h"
#include "models/features.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define AMBILUX_LANES __attribute__((flatten, target_clones("arch=x86-64-v4", "default")))
#else
#define AMBILUX_LANES
#endif

namespace ambilux {

/// What lanes know.
constexpr Features kPlain = {bit(BsdfType::diffuse), bit(EmitterType::area), bit(PrimitiveType::triangle)};

inline Vec3f vector_of(const Vec4f& v) { return {v.x, v.y, v.z}; }
inline Vec4f with_word(const Vec3f& v, float word) { return {v.x, v.y, v.z, word}; }

}  // namespace ambilux
