// Half-precision floats (IEEE 754 binary16) as storage.
#pragma once

#include "core/math.h"

#if defined(__F16C__) && !defined(__CUDACC__)
#include <immintrin.h>
#endif

namespace ambilux {

constexpr float kMaxHalf = 65504.0f;

/// Value of a finite half. Exact, so the same everywhere.
AMBILUX_HD float half_to_float(uint32_t h) {
    const uint32_t magnitude = (h & 0x7fffu) << 13;
    // Denormals: the bits as the fraction of a float from 2^-14 on, less 2^-14.
    const float f =
        magnitude < (1u << 23) ? bits_float(magnitude + (113u << 23)) - 0x1p-14f : bits_float(magnitude + (112u << 23));
    return bits_float(float_bits(f) | (h & 0x8000u) << 16);
}

/// Nearest half of a float, ties to even, for |f| <= kMaxHalf.
AMBILUX_HD uint32_t float_to_half(float f) {
    const uint32_t sign = float_bits(f) >> 16 & 0x8000u, magnitude = float_bits(f) & 0x7fffffffu;
    // Denormals: the addition rounds to a multiple of 2^-24.
    if (magnitude < (113u << 23)) return sign | (float_bits(fabsf(f) + 0.5f) - float_bits(0.5f));
    const uint32_t odd = magnitude >> 13 & 1u;
    return sign | ((magnitude - (112u << 23) + 0xfffu + odd) >> 13);
}

/// Four finite halves at an address that is a multiple of 8.
AMBILUX_HD Vec4f load_half4(const void* at) {
#if defined(__F16C__) && !defined(__CUDACC__)
    Vec4f v;
    const __m128 f = _mm_cvtph_ps(_mm_loadl_epi64(static_cast<const __m128i*>(at)));
    memcpy(&v, &f, 16);
    return v;
#else
    uint32_t words[2];
    memcpy(words, __builtin_assume_aligned(at, 8), 8);
#if defined(__CUDA_ARCH__)
    Vec4f v;
    asm("{ .reg .b16 lo, hi; mov.b32 {lo, hi}, %2; cvt.f32.f16 %0, lo; cvt.f32.f16 %1, hi; }"
        : "=f"(v.x), "=f"(v.y)
        : "r"(words[0]));
    asm("{ .reg .b16 lo, hi; mov.b32 {lo, hi}, %2; cvt.f32.f16 %0, lo; cvt.f32.f16 %1, hi; }"
        : "=f"(v.z), "=f"(v.w)
        : "r"(words[1]));
    return v;
#else
    return {half_to_float(words[0] & 0xffffu), half_to_float(words[0] >> 16), half_to_float(words[1] & 0xffffu),
            half_to_float(words[1] >> 16)};
#endif
#endif
}

}  // namespace ambilux
