// The 80-byte node of the compressed wide BVH (Ylitie, Karras, Laine 2017, section 3), and the test of a ray against
// its eight children.
#pragma once

#include <cstddef>
#include <cstring>

#include "accel/reciprocal.h"
#include "core/math.h"
#include "scene/ray.h"

// All eight children of a node at once, on hosts that have the instructions.
#if defined(__AVX2__) && defined(__FMA__) && defined(__BMI2__) && !defined(__CUDACC__)
#define AMBILUX_WIDE_BOXES
#include <immintrin.h>
#endif

namespace ambilux {

/// Eight children in boxes quantised to a grid of 256 steps per axis from `p`. Inner children follow each other at
/// `first_child`, primitives of leaves at `first_primitive`, both in the order of slots. The paper's byte per child
/// (its figure 2) would have to be decoded for every child that is hit; here hit children set bits that are known at
/// compile time, and `valid` takes out those that stand for nothing.
struct alignas(16) CwbvhNode {
    float p[3];
    uint32_t scale_xz;  ///< floats of 2^15 steps, which have no mantissa: x in the upper half, z's upper half in the
                        ///< lower one
    uint32_t first_child, first_primitive;
    uint32_t
        valid;  ///< bit 24 + slot: an inner child; bits 3 slot to 3 slot + 2: primitives of a leaf, counted in unary
    float scale_y;                                ///< likewise
    uint32_t lower_x[2], lower_y[2], lower_z[2];  ///< four children per word, lowest byte first
    uint32_t upper_x[2], upper_y[2], upper_z[2];
};
static_assert(sizeof(CwbvhNode) == 80);

/// In place of a node: an instance, whose ray goes on in the tree of its group. Only here `valid` is 0, but for the
/// root of an empty tree, which has no `root` either.
struct alignas(16) CwbvhInstance {
    float unused[4];
    uint32_t root;       ///< index of the node where the group's tree begins
    uint32_t id_offset;  ///< from stored primitives to those of this instance, modulo 2^32
    uint32_t valid;      ///< 0
    uint32_t unused_too;
    Affine to_group;
};
static_assert(sizeof(CwbvhInstance) == sizeof(CwbvhNode) &&
              offsetof(CwbvhInstance, valid) == offsetof(CwbvhNode, valid));

AMBILUX_HD bool is_instance(const CwbvhNode& node) { return node.valid == 0 && node.first_child != 0; }

/// Primitive as leaves hold it: a triangle's vertices and as much of its normal as there is room for, or for an
/// analytic shape its id alone.
struct alignas(16) CwbvhPrimitive {
    static constexpr uint32_t kLetsPass = 0x80000000u;

    Vec3f v0;
    uint32_t word;  ///< its number, and kLetsPass if rays may pass through it, as in scenes with Features::opacity
                    ///< only: no other primitive needs to be asked for its opacity
    Vec3f v1;
    float normal_x;
    Vec3f v2;
    float normal_y;

    template <Features F>
    AMBILUX_HD uint32_t prim() const {
        return F.opacity ? word & ~kLetsPass : word;
    }
    AMBILUX_HD bool lets_pass() const { return word & kLetsPass; }
};
static_assert(sizeof(CwbvhPrimitive) == 48);

/// Share of a quantisation step by which boxes are larger than what they hold. Covers the rounding of quantised planes
/// in child_hits (2^-9).
constexpr float kCwbvhMargin = 0.01f;
/// Entries of a traversal stack; a builder refuses deeper trees.
constexpr int kCwbvhStackSize = 48;

/// What the box test needs of a ray.
struct CwbvhRay {
    Vec3f o;
    Vec3f inverse_d;
    uint32_t order;  ///< bits 8 to 10: axes along which the ray ascends; the other bytes are those of 1.0f
                     ///< (detail::byte_in_mantissa)
};

AMBILUX_HD CwbvhRay make_cwbvh_ray(Vec3f o, Vec3f d) {
    CwbvhRay ray;
    ray.o = o;
    // Directions in a plane get a tiny slope, so that no product is 0·inf.
    for (int i = 0; i < 3; ++i)
        ray.inverse_d[i] = fabsf(d[i]) > 1e-20f ? ordinary_reciprocal(d[i]) : copysignf(1e20f, d[i]);
    ray.order = 0x3f800000u | (ray.inverse_d.x < 0.0f ? 0u : 0x100u) | (ray.inverse_d.y < 0.0f ? 0u : 0x200u) |
                (ray.inverse_d.z < 0.0f ? 0u : 0x400u);
    return ray;
}

/// The part of `node`, an instance, that moves rays: the parameter along them stays the same.
AMBILUX_HD Affine instance_transform(const CwbvhNode& n) {
    return {{{bits_float(n.lower_x[0]), bits_float(n.lower_x[1]), bits_float(n.lower_y[0]), bits_float(n.lower_y[1])},
             {bits_float(n.lower_z[0]), bits_float(n.lower_z[1]), bits_float(n.upper_x[0]), bits_float(n.upper_x[1])},
             {bits_float(n.upper_y[0]), bits_float(n.upper_y[1]), bits_float(n.upper_z[0]), bits_float(n.upper_z[1])}}};
}

/// A set of hit children. Bits 24 to 31: inner nodes in order of visit, the highest first; bits 0 to 7: the node's
/// inner children by slot.
struct CwbvhGroup {
    uint32_t base, hits;
};

/// A set of hit primitives, bits as in CwbvhNode::valid.
struct CwbvhLeaves {
    uint32_t base, hits, valid;
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

AMBILUX_HD int count_bits(uint32_t x) {
#if defined(__CUDA_ARCH__)
    return __popc(x);
#else
    return __builtin_popcount(x);
#endif
}

/// 1 + byte·2^-15: one byte permutation on a device, where converting an integer costs four times as much. `one` holds
/// the bytes of 1.0f but the second: from a register that the compiler cannot see through, since an instruction has
/// room for one constant only, and the choice of bytes is one already.
template <int Byte>
AMBILUX_HD float byte_in_mantissa(uint32_t word, uint32_t one) {
#if defined(__CUDA_ARCH__)
    // Result bytes, lowest first: 0x00, word[Byte], 0x80, 0x3f.
    return __uint_as_float(__byte_perm(word, one, 0x7604u | unsigned(Byte) << 4));
#else
    return bits_float((one & 0xffff00ffu) | (word >> (8 * Byte) & 255u) << 8);
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

/// Largest and least of three: one instruction each on devices since Hopper, for integers only.
AMBILUX_HD int largest(int a, int b, int c) {
#if defined(__CUDA_ARCH__)
    return __vimax3_s32(a, b, c);
#else
    return a > b ? (a > c ? a : c) : (b > c ? b : c);
#endif
}
AMBILUX_HD int least(int a, int b, int c) {
#if defined(__CUDA_ARCH__)
    return __vimin3_s32(a, b, c);
#else
    return a < b ? (a < c ? a : c) : (b < c ? b : c);
#endif
}

/// Planes of one axis: t of byte b is fma(1 + b 2^-15, scale, near or far).
struct SlabAxis {
    float scale, near, far;
};

AMBILUX_HD SlabAxis slab_axis(float p, float steps, float o, float inverse_d) {
    // Near and far planes move apart by the rounding of (p-o)/d and of what a triangle test makes of it, so that boxes
    // only grow (Ize 2013, applied to the corner; the part that grows with the quantised offset is in kCwbvhMargin).
    constexpr float k = gamma_bound(12);
    const float a = (p - o) * inverse_d;
    const float scale = steps * inverse_d;
    const float corner = a - scale;
    // Rounding of `corner` at the magnitude of `a` is one of those steps; at the magnitude of `scale` it is 2^-9 of a
    // quantisation step.
    return {scale, fmaf(-k, fabsf(a), corner), fmaf(k, fabsf(a), corner)};
}

/// The bits of child `Slot` in CwbvhNode::valid, if the ray meets its box.
template <int Slot>
AMBILUX_HD uint32_t child_bits(const SlabAxis& x, const SlabAxis& y, const SlabAxis& z, uint32_t near_x,
                               uint32_t near_y, uint32_t near_z, uint32_t far_x, uint32_t far_y, uint32_t far_z,
                               uint32_t one, int tmax) {
    constexpr int b = Slot % 4;
    const int nx = int(float_bits(fmaf(byte_in_mantissa<b>(near_x, one), x.scale, x.near))),
              fx = int(float_bits(fmaf(byte_in_mantissa<b>(far_x, one), x.scale, x.far)));
    const int ny = int(float_bits(fmaf(byte_in_mantissa<b>(near_y, one), y.scale, y.near))),
              fy = int(float_bits(fmaf(byte_in_mantissa<b>(far_y, one), y.scale, y.far)));
    const int nz = int(float_bits(fmaf(byte_in_mantissa<b>(near_z, one), z.scale, z.near))),
              fz = int(float_bits(fmaf(byte_in_mantissa<b>(far_z, one), z.scale, z.far)));
    // Compared as integers, which order positive floats alike and negative ones the other way round, but below them. A
    // negative far plane therefore makes the least negative, and the largest of the near ones is no less than that only
    // if the box lies behind the origin.
    const int near = largest(nx, ny, nz), far = least(fx, fy, fz);
    return near <= (far < tmax ? far : tmax) ? 1u << (24 + Slot) | 7u << (3 * Slot) : 0u;
}

#if defined(AMBILUX_WIDE_BOXES)
/// t of one plane of each child, bits as child_bits() has them.
inline __m256i planes_of_children(const uint32_t (&bytes)[2], float scale, float corner) {
    const __m256i mantissa =
        _mm256_slli_epi32(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(bytes))), 8);
    const __m256 in_steps = _mm256_castsi256_ps(_mm256_or_si256(mantissa, _mm256_set1_epi32(0x3f800000)));
    return _mm256_castps_si256(_mm256_fmadd_ps(in_steps, _mm256_set1_ps(scale), _mm256_set1_ps(corner)));
}
#endif

/// Moves bit s of the upper byte to 24 + (s ^ axes of `order`): exchanges neighbours, pairs, halves.
AMBILUX_HD uint32_t sort_slots(uint32_t hits, uint32_t order) {
    uint32_t t = (hits ^ hits >> 1) & (order & 0x100u) * 0x550000u;
    hits ^= t ^ t << 1;
    t = (hits ^ hits >> 2) & (order & 0x200u) * (0x330000u / 2);
    hits ^= t ^ t << 2;
    t = (hits ^ hits >> 4) & (order & 0x400u) * (0x0f0000u / 4);
    return hits ^ t ^ t << 4;
}

}  // namespace detail

/// Children of `node` whose boxes meet the ray before tmax, bits as in CwbvhNode::valid.
AMBILUX_HD uint32_t child_hits(const CwbvhNode& node, const CwbvhRay& ray, float tmax) {
    const detail::SlabAxis x =
        detail::slab_axis(node.p[0], bits_float(node.scale_xz & 0x7f800000u), ray.o.x, ray.inverse_d.x);
    const detail::SlabAxis y = detail::slab_axis(node.p[1], node.scale_y, ray.o.y, ray.inverse_d.y);
    const detail::SlabAxis z = detail::slab_axis(node.p[2], bits_float(node.scale_xz << 16), ray.o.z, ray.inverse_d.z);
    const bool px = ray.inverse_d.x >= 0.0f, py = ray.inverse_d.y >= 0.0f, pz = ray.inverse_d.z >= 0.0f;
    const int end = int(float_bits(tmax));
#if defined(AMBILUX_WIDE_BOXES)
    const auto planes = detail::planes_of_children;
    const __m256i near = _mm256_max_epi32(_mm256_max_epi32(planes(px ? node.lower_x : node.upper_x, x.scale, x.near),
                                                           planes(py ? node.lower_y : node.upper_y, y.scale, y.near)),
                                          planes(pz ? node.lower_z : node.upper_z, z.scale, z.near));
    const __m256i far = _mm256_min_epi32(
        _mm256_min_epi32(planes(px ? node.upper_x : node.lower_x, x.scale, x.far),
                         planes(py ? node.upper_y : node.lower_y, y.scale, y.far)),
        _mm256_min_epi32(planes(pz ? node.upper_z : node.lower_z, z.scale, z.far), _mm256_set1_epi32(end)));
    const uint32_t met = ~uint32_t(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(near, far)))) & 0xffu;
    return (met << 24 | 7u * _pdep_u32(met, 0x249249u)) & node.valid;
#else
    uint32_t hits = 0;
    {
        const uint32_t near_x = px ? node.lower_x[0] : node.upper_x[0], far_x = px ? node.upper_x[0] : node.lower_x[0];
        const uint32_t near_y = py ? node.lower_y[0] : node.upper_y[0], far_y = py ? node.upper_y[0] : node.lower_y[0];
        const uint32_t near_z = pz ? node.lower_z[0] : node.upper_z[0], far_z = pz ? node.upper_z[0] : node.lower_z[0];
        hits |= detail::child_bits<0>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
        hits |= detail::child_bits<1>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
        hits |= detail::child_bits<2>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
        hits |= detail::child_bits<3>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
    }
    {
        const uint32_t near_x = px ? node.lower_x[1] : node.upper_x[1], far_x = px ? node.upper_x[1] : node.lower_x[1];
        const uint32_t near_y = py ? node.lower_y[1] : node.upper_y[1], far_y = py ? node.upper_y[1] : node.lower_y[1];
        const uint32_t near_z = pz ? node.lower_z[1] : node.upper_z[1], far_z = pz ? node.upper_z[1] : node.lower_z[1];
        hits |= detail::child_bits<4>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
        hits |= detail::child_bits<5>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
        hits |= detail::child_bits<6>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
        hits |= detail::child_bits<7>(x, y, z, near_x, near_y, near_z, far_x, far_y, far_z, ray.order, end);
    }
    return hits & node.valid;
#endif
}

/// Splits what child_hits() says into inner nodes, first along the ray first unless any order will do, and primitives.
AMBILUX_HD CwbvhGroup inner_hits(const CwbvhNode& node, uint32_t hits, uint32_t order) {
    return {node.first_child, (detail::sort_slots(hits & kCwbvhInnerBits, order)) | node.valid >> 24};
}
AMBILUX_HD CwbvhLeaves leaf_hits(const CwbvhNode& node, uint32_t hits) {
    return {node.first_primitive, hits & ~kCwbvhInnerBits, node.valid};
}

/// Takes the first inner child out of `group` and returns its node index.
AMBILUX_HD uint32_t take_child(CwbvhGroup& group, uint32_t order) {
    const int bit = detail::highest_bit(group.hits);
    group.hits &= ~(1u << bit);
    const uint32_t slot = (uint32_t(bit) ^ order >> 8) & 7u;
    return group.base + uint32_t(detail::count_bits(group.hits & ~(~0u << slot)));
}

/// Takes a primitive out of `leaves` and returns its index.
AMBILUX_HD uint32_t take_primitive(CwbvhLeaves& leaves) {
    const uint32_t rest = leaves.hits & (leaves.hits - 1);
    const uint32_t below = (leaves.hits ^ rest) - 1;
    leaves.hits = rest;
    return leaves.base + uint32_t(detail::count_bits(leaves.valid & below));
}

}  // namespace ambilux
