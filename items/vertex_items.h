// Vertices of bidirectional subpaths as queues keep them: with all that connections ask of their surfaces.
#pragma once

#include "items/subpath_items.h"
#include "transport/subpath/vertex.h"

namespace ambilux {

using BidirectionalVertex = Vertex<BidirectionalMis>;
using BidirectionalEnd = SubpathEnd<BidirectionalMis>;

/// Depth (14 bits), type and side of a vertex, and its ray_offset in the upper 15 bits: a float without its sign and
/// its last 16 bits, rounded up by less than 1/128.
struct VertexBits {
    uint32_t bits;

    template <class Mis>
    AMBILUX_HD static VertexBits make(uint32_t depth, const Vertex<Mis>& v) {
        const Scattering& s = v.scattering;
        uint32_t word = depth | (float_bits(v.offset) + 0xffffu) >> 16 << kOffsetBit;
        if (s.plain_diffuse()) word |= kDiffuse;
        if (bsdf_transmits(s.bsdf.type)) word |= kThrough;
        if (dot(s.ng, s.wi_world) > 0.0f) word |= kAbove;
        return VertexBits{word};
    }

    AMBILUX_HD uint32_t depth() const { return bits & kMaxDepth; }
    AMBILUX_HD float offset() const { return bits_float(bits >> kOffsetBit << 16); }
    /// True if kernels of features F know or can tell that it is Scattering::plain_diffuse().
    template <Features F>
    AMBILUX_HD bool diffuse() const {
        if constexpr (!F.several_bsdfs())
            return F.has(BsdfType::diffuse);
        else
            return bits & kDiffuse;
    }
    /// False if nothing is scattered towards `w`. `ng`: Scattering::ng; neither need be unit.
    AMBILUX_HD bool reaches(Vec3f ng, Vec3f w) const {
        return bits & kThrough || (dot(ng, w) > 0.0f) == bool(bits & kAbove);
    }

private:
    static constexpr uint32_t kDiffuse = 1u << kDepthBits, kThrough = 2 * kDiffuse, kAbove = 4 * kDiffuse,
                              kOffsetBit = kDepthBits + 3;
    static_assert(kOffsetBit + 15 == 32);
};

/// What tells whether a vertex can be connected with a point, and which is next: memory moves 32 bytes at a time, and
/// most pairs need no more.
struct ConnectionVertexFront {
    Vec3f p;
    VertexBits bits;
    Vec2f ng;       ///< octahedral map of Scattering::ng
    uint32_t link;  ///< of vertices that are kept over a wave: the one before it of the same subpath, or kNone; else
                    ///< the path
    float sum1;     ///< word 1 of the sums
};

/// A vertex to be connected with one of the other subpath, in few bytes: kernels that do so wait for memory. Directions
/// are octahedral maps in whole floats, right to 5e-7.
template <class Mis>
struct ConnectionVertex {
    using Sums = PackedSums<2, vertex_words<typename Mis::Sums>()>;
    static constexpr uint32_t kPairedLanes = 6;
    static constexpr uint32_t kDiffuseLanes = 4 + Sums::More::kLanes;  ///< what there is of a diffuse one

    ConnectionVertexFront front;
    Rgb throughput;  ///< of a diffuse vertex: times its reflectance
    float sum0;
    Vec2f d, n;  ///< of the ray that met it; frame.n
    typename Sums::More more;
    Vec3f tangent;  ///< ScatteringParts
    uint32_t record;
    Rgb color0;  ///< BsdfInputs, where there are textures
    float number0;
    Rgb color1;
    float number1;

    /// Lanes that kernels of features F use.
    template <Features F>
    static constexpr uint32_t lanes() {
        return F.bsdfs == bit(BsdfType::diffuse) ? kDiffuseLanes : kDiffuseLanes + (F.textures ? 3 : 1);
    }
    AMBILUX_HD VertexBits bits() const { return front.bits; }
    AMBILUX_HD uint32_t path() const { return front.link; }
};

/// A vertex for a stage that connects it with emitters or the camera where shade does not: as it is, so that images do
/// not depend on that.
template <class Mis>
struct VertexItem {
    using Sums = PackedSums<2, vertex_words<typename Mis::Sums>()>;
    static constexpr uint32_t kPairedLanes = 8;
    static constexpr uint32_t kDiffuseLanes = 6 + Sums::More::kLanes;

    Vec3f p;
    VertexBits head;
    Vec3f d;
    uint32_t path;
    Rgb throughput;
    float sum0;
    Vec3f ng;
    float sum1;
    Vec3f n;
    float offset;
    Rgb color0;  ///< BsdfInputs
    uint32_t record;
    typename Sums::More more;
    Vec3f tangent;
    float number0;
    Rgb color1;
    float number1;

    template <Features F>
    static constexpr uint32_t lanes() {
        return F.bsdfs == bit(BsdfType::diffuse) ? kDiffuseLanes : kDiffuseLanes + (F.textures ? 2 : 1);
    }
    AMBILUX_HD VertexBits bits() const { return head; }
};

/// Lanes of `item` that hold something.
template <Features F, class Item>
AMBILUX_HD uint32_t lanes_of(const Item& item) {
    return item.bits().template diffuse<F>() ? Item::kDiffuseLanes : Item::template lanes<F>();
}

namespace detail {

template <Features F, class Mis>
AMBILUX_HD SubpathEnd<Mis> unpack_end(const SceneView& scene, Vec3f p, VertexBits bits, float offset,
                                      const ScatteringParts& parts, Vec3f d, const typename Mis::Sums& sums,
                                      Rgb throughput) {
    SubpathEnd<Mis> end = {{}, throughput, bits.depth()};
    Vertex<Mis>& v = end.vertex;
    v.point.p = p;
    v.point.ng = parts.ng;
    v.offset = offset;
    v.scattering = bits.template diffuse<F>() ? diffuse_scattering(parts, -d) : scattering_of<F>(scene, parts, -d);
    v.sums = sums;
    v.first = end.depth == 1;
    return end;
}

}  // namespace detail

/// The vertex `v` that the ray of `path` met; `slot`: of the subpath.
template <class Mis>
AMBILUX_HD VertexItem<Mis> pack_vertex(const Vertex<Mis>& v, const Subpath<Mis>& path, uint32_t slot) {
    const ScatteringParts s = parts_of(v.scattering);
    const auto sums = VertexItem<Mis>::Sums::pack(v.sums);
    return {v.point.p,
            VertexBits::make(path.depth, v),
            path.direction,
            slot,
            path.throughput,
            sums.word[0],
            s.ng,
            sums.word[1],
            s.n,
            v.offset,
            s.inputs.colors[0],
            s.record,
            sums.more,
            s.tangent,
            s.inputs.numbers[0],
            s.inputs.colors[1],
            s.inputs.numbers[1]};
}

/// The vertex `v` that the ray of `path` met. `link`: ConnectionVertexFront.
template <class Mis>
AMBILUX_HD ConnectionVertex<Mis> pack_connection_vertex(const Vertex<Mis>& v, const Subpath<Mis>& path, uint32_t link) {
    const ScatteringParts s = parts_of(v.scattering);
    const auto sums = ConnectionVertex<Mis>::Sums::pack(v.sums);
    Rgb throughput = path.throughput;
    if (v.scattering.plain_diffuse()) throughput *= s.inputs.colors[0];
    return {{v.point.p, VertexBits::make(path.depth, v), octahedral_encode(s.ng), link, sums.word[1]},
            throughput,
            sums.word[0],
            octahedral_encode(path.direction),
            octahedral_encode(s.n),
            sums.more,
            s.tangent,
            s.record,
            s.inputs.colors[0],
            s.inputs.numbers[0],
            s.inputs.colors[1],
            s.inputs.numbers[1]};
}

/// The end of a subpath that was packed; of its point p and ng only, and of diffuse ones no tangents.
template <Features F, class Mis>
AMBILUX_HD SubpathEnd<Mis> unpack_end(const SceneView& scene, const VertexItem<Mis>& item) {
    const typename VertexItem<Mis>::Sums sums = {{item.sum0, item.sum1}, item.more};
    return detail::unpack_end<F, Mis>(
        scene, item.p, item.head, item.offset,
        {item.ng, item.n, item.tangent, item.record, {{item.color0, item.color1}, {item.number0, item.number1}}},
        item.d, sums.template unpack<typename Mis::Sums>(), item.throughput);
}
/// The same, with an offset that is rounded up; diffuse ones have reflectance 1.
template <Features F, class Mis>
AMBILUX_HD SubpathEnd<Mis> unpack_end(const SceneView& scene, const ConnectionVertex<Mis>& item) {
    const VertexBits bits = item.front.bits;
    const Rgb color = bits.template diffuse<F>() ? splat(1.0f) : item.color0;
    const typename ConnectionVertex<Mis>::Sums sums = {{item.sum0, item.front.sum1}, item.more};
    return detail::unpack_end<F, Mis>(scene, item.front.p, bits, bits.offset(),
                                      {octahedral_decode(item.front.ng),
                                       octahedral_decode(item.n),
                                       item.tangent,
                                       item.record,
                                       {{color, item.color1}, {item.number0, item.number1}}},
                                      octahedral_decode(item.d), sums.template unpack<typename Mis::Sums>(),
                                      item.throughput);
}

/// What pack_connection_vertex and unpack_end make of `v` together, for a host that connects it where it is made:
/// rounded as in a queue, so that images do not depend on which stages are fused, with the BSDF that it has.
template <Features F, class Mis>
AMBILUX_HD SubpathEnd<Mis> rounded_end(const SceneView& scene, const Vertex<Mis>& v, const Subpath<Mis>& path) {
    const auto rounded = [](Vec3f d) { return octahedral_decode(octahedral_encode(d)); };
    const VertexBits bits = VertexBits::make(path.depth, v);
    const Vec3f wi_world = -rounded(path.direction);
    ScatteringParts parts = parts_of(v.scattering);
    parts.ng = rounded(parts.ng);
    parts.n = rounded(parts.n);
    SubpathEnd<Mis> end = {v, path.throughput, path.depth};
    end.vertex.point.ng = parts.ng;
    end.vertex.offset = bits.offset();
    Scattering& s = end.vertex.scattering;
    if (bits.template diffuse<F>()) {
        end.throughput *= parts.inputs.colors[0];
        parts.inputs.colors[0] = splat(1.0f);
        s = diffuse_scattering(parts, wi_world);
    } else {
        s = frame_of<F>(scene, parts, wi_world);
        s.bsdf = v.scattering.bsdf;
    }
    return end;
}

/// False if no light can pass between a vertex that is in a queue and `z`, of the other subpath.
template <class Mis>
AMBILUX_HD bool may_connect(const ConnectionVertexFront& y, const Vertex<Mis>& z) {
    const Vec3f w = z.point.p - y.p;
    return y.bits.reaches(octahedral_direction(y.ng), w) && may_scatter(z.scattering, -w) && !in_plane(z, w);
}

// A third sum of a vertex begins a lane, whose other words are free (docs/architecture.md).
static_assert(sizeof(ConnectionVertexFront) == 2 * 16 && sizeof(ConnectionVertex<BidirectionalMis>) == 7 * 16);
static_assert(sizeof(VertexItem<BidirectionalMis>) == 8 * 16 && sizeof(VertexItem<UnidirectionalMis>) == 8 * 16);

}  // namespace ambilux
