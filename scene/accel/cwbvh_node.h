// The 80-byte node of the compressed wide BVH (Ylitie, Karras, Laine 2017, section 3), and the test of a ray against its eight children.
#pragma once

#include <cstring>

#include "core/math.h"
#include "scene/ray.h"

namespace ambilux {

/// Eight children in boxes quantised to a grid of 256 steps per axis from `p`, steps 2^(e-127).
/// meta byte of a child: 0 = none; inner node: 0b001xxxxx with x = 24 + slot; leaf: count of primitives in unary in the upper 3 bits, offset of the first
/// one from `first_primitive` in the lower 5. Inner children follow each other at `first_child` in the order of slots.
struct alignas(16) CwbvhNode {
    float p[3];
    uint8_t e[3];
    uint8_t inner_mask;  ///< bit per slot
    uint32_t first_child, first_primitive;
    uint32_t meta[2];  ///< four children per word, lowest byte first; likewise below
    uint32_t lower_x[2], lower_y[2], lower_z[2];
    uint32_t upper_x[2], upper_y[2], upper_z[2];
};
static_assert(sizeof(CwbvhNode) == 80);

/// Primitive as leaves hold it: a triangle's vertices, or for an analytic shape its id alone.
struct alignas(16) CwbvhPrimitive {
    Vec3f v0;
    uint32_t prim;
    Vec3f v1;
    uint32_t pad1;
    Vec3f v2;
    uint32_t pad2;
};
static_assert(sizeof(CwbvhPrimitive) == 48);

/// Share of a quantisation step by which boxes are larger than what they hold. Covers the rounding of quantised planes in child_hits (2^-9).
constexpr float kCwbvhMargin = 0.01f;
/// Entries of a traversal stack; a builder refuses deeper trees.
constexpr int kCwbvhStackSize = 48;

/// What the box test needs of a ray.
struct CwbvhRay {
    Vec3f o;
    Vec3f inverse_d;
    uint32_t octant_inverse;  ///< 7 - octant; bit k of the octant is set where d[k] < 0
};

AMBILUX_HD CwbvhRay make_cwbvh_ray(Vec3f o, Vec3f d) {
    CwbvhRay ray;
    ray.o = o;
    // Directions in a plane get a tiny slope, so that no product is 0·inf.
    const float tiny = 1e-20f;
    for (int i = 0; i < 3; ++i) ray.inverse_d[i] = 1.0f / (fabsf(d[i]) > tiny ? d[i] : copysignf(tiny, d[i]));
    ray.octant_inverse = (ray.inverse_d.x < 0.0f ? 0u : 1u) | (ray.inverse_d.y < 0.0f ? 0u : 2u) | (ray.inverse_d.z < 0.0f ? 0u : 4u);
    return ray;
}

/// A set of hit children or primitives. Inner nodes: bits 24..31 are hits in order of visit, bits 0..7 the node's inner_mask. Primitives: bits 0..23 by offset.
struct CwbvhGroup {
    uint32_t base, hits;
};

constexpr uint32_t kCwbvhInnerBits = 0xff000000u;

namespace detail {

AMBILUX_HD int highest_bit(uint32_t x) {
#if defined(__CUDA_ARCH__)
    return 31 - __clz(int(x));
#else
    return 31 - __builtin_clz(x);
#endif
}

AMBILUX_HD int lowest_bit(uint32_t x) {
#if defined(__CUDA_ARCH__)
    return __ffs(int(x)) - 1;
#else
    return __builtin_ctz(x);
#endif
}

AMBILUX_HD int count_bits(uint32_t x) {
#if defined(__CUDA_ARCH__)
    return __popc(x);
#else
    return __builtin_popcount(x);
#endif
}

/// 1 + byte·2^-15: one byte permutation on a device, where converting an integer costs four times as much.
template <int Byte>
AMBILUX_HD float byte_in_mantissa(uint32_t word) {
#if defined(__CUDA_ARCH__)
    // Result bytes, lowest first: 0x00, word[Byte], 0x80, 0x3f.
    return __uint_as_float(__byte_perm(word, 0x3f800000u, 0x7604u | unsigned(Byte) << 4));
#else
    return bits_float(0x3f800000u | (word >> (8 * Byte) & 255u) << 8);
#endif
}

/// Loads 16-byte aligned records as 16-byte words through the read-only path.
template <class T>
AMBILUX_HD T load_record(const T* address) {
    static_assert(sizeof(T) % 16 == 0 && alignof(T) >= 16);
#if defined(__CUDA_ARCH__)
    union Words {
        __device__ Words() {}
        uint4 words[sizeof(T) / 16];
        T value;
    } r;
    const uint4* words = reinterpret_cast<const uint4*>(address);
#pragma unroll
    for (int i = 0; i < int(sizeof(T) / 16); ++i) r.words[i] = __ldg(words + i);
    return r.value;
#else
    return *address;
#endif
}

/// Planes of one axis: t of byte b is fma(1 + b 2^-15, scale, near or far).
struct SlabAxis {
    float scale, near, far;
};

AMBILUX_HD SlabAxis slab_axis(float p, uint32_t exponent, float o, float inverse_d) {
    // Near and far planes move apart by the rounding of (p-o)/d and of what a triangle test makes of it, so that boxes only grow (Ize 2013, applied to the corner;
    // the part that grows with the quantised offset is in kCwbvhMargin).
    constexpr float k = gamma_bound(10);
    const float step = bits_float(exponent << 23) * inverse_d;
    const float a = (p - o) * inverse_d;
    const float scale = step * 32768.0f;
    const float corner = a - scale;
    // Rounding of `corner` at the magnitude of `a` is one of those steps; at the magnitude of `scale` it is 2^-9 of a quantisation step.
    return {scale, fmaf(-k, fabsf(a), corner), fmaf(k, fabsf(a), corner)};
}

template <int Byte>
AMBILUX_HD bool child_hit(const SlabAxis& x, const SlabAxis& y, const SlabAxis& z, uint32_t near_x, uint32_t near_y, uint32_t near_z, uint32_t far_x,
                          uint32_t far_y, uint32_t far_z, float tmax) {
    const float nx = fmaf(byte_in_mantissa<Byte>(near_x), x.scale, x.near), fx = fmaf(byte_in_mantissa<Byte>(far_x), x.scale, x.far);
    const float ny = fmaf(byte_in_mantissa<Byte>(near_y), y.scale, y.near), fy = fmaf(byte_in_mantissa<Byte>(far_y), y.scale, y.far);
    const float nz = fmaf(byte_in_mantissa<Byte>(near_z), z.scale, z.near), fz = fmaf(byte_in_mantissa<Byte>(far_z), z.scale, z.far);
    return max(max(nx, ny), max(nz, 0.0f)) <= min(min(fx, fy), min(fz, tmax));
}

}  // namespace detail

/// Children of `node` whose boxes meet the ray before tmax: bits 24..31 inner nodes, bit 24 + (slot ^ octant_inverse), so that the highest bit is to be
/// visited first; bits 0..23 primitives by offset.
AMBILUX_HD uint32_t child_hits(const CwbvhNode& node, const CwbvhRay& ray, float tmax) {
    const detail::SlabAxis x = detail::slab_axis(node.p[0], node.e[0], ray.o.x, ray.inverse_d.x);
    const detail::SlabAxis y = detail::slab_axis(node.p[1], node.e[1], ray.o.y, ray.inverse_d.y);
    const detail::SlabAxis z = detail::slab_axis(node.p[2], node.e[2], ray.o.z, ray.inverse_d.z);
    const bool px = ray.inverse_d.x >= 0.0f, py = ray.inverse_d.y >= 0.0f, pz = ray.inverse_d.z >= 0.0f;
    uint32_t hits = 0;
    for (int half = 0; half < 2; ++half) {
        const uint32_t meta = node.meta[half];
        // Inner children have bits 3 and 4 of their slot number (24 + slot) set, leaves never both: offsets stop at 23.
        const uint32_t inner = (meta & meta << 1) >> 4 & 0x01010101u;
        const uint32_t index = (meta ^ inner * ray.octant_inverse) & 0x1f1f1f1fu;
        const uint32_t bits = meta >> 5 & 0x07070707u;
        const uint32_t near_x = px ? node.lower_x[half] : node.upper_x[half], far_x = px ? node.upper_x[half] : node.lower_x[half];
        const uint32_t near_y = py ? node.lower_y[half] : node.upper_y[half], far_y = py ? node.upper_y[half] : node.lower_y[half];
        const uint32_t near_z = pz ? node.lower_z[half] : node.upper_z[half], far_z = pz ? node.upper_z[half] : node.lower_z[half];
        if (detail::child_hit<0>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax)) hits |= (bits & 255u) << (index & 255u);
        if (detail::child_hit<1>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax)) hits |= (bits >> 8 & 255u) << (index >> 8 & 255u);
        if (detail::child_hit<2>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax)) hits |= (bits >> 16 & 255u) << (index >> 16 & 255u);
        if (detail::child_hit<3>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, tmax)) hits |= (bits >> 24) << (index >> 24);
    }
    return hits;
}

/// Takes the first inner child out of `group` and returns its node index.
AMBILUX_HD uint32_t take_child(CwbvhGroup& group, uint32_t octant_inverse) {
    const int bit = detail::highest_bit(group.hits);
    group.hits &= ~(1u << bit);
    const uint32_t slot = uint32_t(bit - 24) ^ octant_inverse;
    return group.base + uint32_t(detail::count_bits(group.hits & ~(~0u << slot)));
}

}  // namespace ambilux
