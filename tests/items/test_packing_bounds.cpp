// libs: ambilux_formats ambilux_accel ambilux_core
// timeout: 60
// What items keep of numbers: bits where they are exact, and the stated share where they are rounded.
#include <cmath>
#include <cstring>
#include <set>

#include "items/candidate_items.h"
#include "items/vertex_items.h"
#include "tests/support/bounds.h"
#include "tests/support/catch.h"
#include "transport/subpath/roulette.h"

using namespace ambilux;
using namespace ambilux::bounds;

namespace {

/// Any bits of a float, infinities and NaNs among them.
float any_float(Numbers& numbers) { return bits_float(uint32_t(numbers.rng())); }
Vec3f any_vector(Numbers& numbers) { return {any_float(numbers), any_float(numbers), any_float(numbers)}; }

template <class T>
bool same_bits(const T& a, const T& b) {
    return std::memcmp(&a, &b, sizeof a) == 0;
}

}  // namespace

TEST_CASE("Depth and flag of a subpath are kept exactly, its roulette scale to 2^-7 below, and the same again") {
    Numbers numbers(1);
    for (int i = 0; i < 200000; ++i) {
        const float scale = i % 2 ? numbers.magnitude(-37, 38) : bits_float(uint32_t(numbers.rng()) & 0x7f7fffffu);
        const float kept = rounded_scale(scale);
        REQUIRE(kept <= scale);
        if (scale >= 0x1p-126f) REQUIRE(double(kept) > double(scale) * (1 - 0x1p-7));
        REQUIRE(rounded_scale(kept) == kept);
        const uint32_t depth = i % 5 ? numbers.index(kMaxDepth + 1) : kMaxDepth;
        const bool delta = numbers.chance(0.5f);
        const SubpathBits bits = SubpathBits::make(depth, delta, kept);
        REQUIRE(bits.depth() == depth);
        REQUIRE(bits.delta() == delta);
        REQUIRE(same_bits(bits.roulette_scale(), kept));
    }
}

TEST_CASE("The ray offset of a vertex is kept rounded up, by less than 1/128, from 1e-37 to 1e38") {
    Numbers numbers(2);
    BidirectionalVertex v = {};
    v.scattering.bsdf.type = BsdfType::diffuse;
    v.scattering.ng = v.scattering.wi_world = {0, 0, 1};
    for (int i = 0; i < 200000; ++i) {
        v.offset = i % 7 == 0 ? bits_float((1u + numbers.index(253)) << 23 | (i % 2 ? 0x7fffffu : 0u))
                              : numbers.magnitude(-37, 38);
        const uint32_t depth = numbers.index(kMaxDepth + 1);
        const VertexBits bits = VertexBits::make(depth, v);
        REQUIRE(bits.depth() == depth);
        REQUIRE(bits.offset() >= v.offset);
        REQUIRE(double(bits.offset()) < double(v.offset) * (1 + 1.0 / 128));
        REQUIRE(bits.diffuse<kAllFeatures>());
        REQUIRE(bits.reaches({0, 0, 1}, {0, 0, 1}));
        REQUIRE_FALSE(bits.reaches({0, 0, 1}, {0, 0, -1}));
    }
    v.offset = 0;
    CHECK(VertexBits::make(3, v).offset() == 0);
}

TEST_CASE("Rays of subpaths come back with the bits that went in, whatever they are") {
    Numbers numbers(3);
    for (int i = 0; i < 100000; ++i) {
        const uint32_t depth = i % 3 ? 1 + numbers.index(kMaxDepth) : 1;
        const float scale = rounded_scale(numbers.magnitude(-30, 30));
        Subpath<UnidirectionalMis> alone = {any_vector(numbers),
                                            any_vector(numbers),
                                            any_vector(numbers),
                                            {any_float(numbers)},
                                            depth,
                                            scale,
                                            i % 2 == 0,
                                            {}};
        using Alone = SubpathItems<UnidirectionalMis>;
        const float tmax = any_float(numbers);
        const PathRay ray = Alone::pack(alone, Side::eye, 7, tmax);
        const auto a = Alone::unpack(ray);
        REQUIRE((same_bits(a.origin, alone.origin) && same_bits(a.direction, alone.direction) &&
                 same_bits(a.throughput, alone.throughput)));
        if (depth > 1) REQUIRE(same_bits(a.sums, alone.sums));
        if (depth == 1) REQUIRE(same_bits(Alone::tmax(ray), tmax));
        REQUIRE((a.depth == depth && a.delta == alone.delta && a.roulette_scale == scale));

        const Side side = numbers.chance(0.5f) ? Side::eye : Side::light;
        Subpath<BidirectionalMis> path = {any_vector(numbers),
                                          any_vector(numbers),
                                          any_vector(numbers),
                                          {any_float(numbers), any_float(numbers)},
                                          depth,
                                          scale,
                                          i % 2 == 0,
                                          {}};
        path.start = {any_float(numbers),
                      any_float(numbers),
                      uint32_t(numbers.rng()),
                      numbers.index(kTickets),
                      opacity_step(numbers.uniform()),
                      any_float(numbers)};
        using Items = SubpathItems<BidirectionalMis>;
        const auto b = Items::unpack(Items::pack(path, side, 7, tmax));
        REQUIRE((same_bits(b.origin, path.origin) && same_bits(b.direction, path.direction) &&
                 same_bits(b.throughput, path.throughput)));
        if (side == Side::eye || depth > 1) REQUIRE(same_bits(b.sums, path.sums));
        if (side == Side::eye && depth == 1) REQUIRE(same_bits(b.start.camera_distance, path.start.camera_distance));
        if (side == Side::light && depth == 1) {
            REQUIRE(
                (same_bits(b.start.inv_pdf, path.start.inv_pdf) && same_bits(b.start.direction, path.start.direction)));
            REQUIRE((b.start.prim == path.start.prim && b.start.emitter == path.start.emitter));
            REQUIRE(b.start.opacity_step == path.start.opacity_step);
        }
    }
}

TEST_CASE("Weights know an opacity rounded up to a step of 1/255, which packing keeps") {
    for (uint32_t k = 1; k <= kOpacitySteps; ++k) {
        const float opacity = float(k) / float(kOpacitySteps);
        INFO(k);
        CHECK(opacity_step(opacity) == k);
        CHECK(opacity_step(weight_opacity(opacity)) == k);
    }
    Numbers numbers(4);
    for (int i = 0; i < 100000; ++i) {
        const float opacity = i % 2 ? numbers.uniform() : numbers.magnitude(-40, 0),
                    kept = weight_opacity(std::min(opacity, 1.0f));
        REQUIRE(kept >= std::min(opacity, 1.0f) * (1 - 0x1p-23f));
        REQUIRE(kept <= std::min(opacity, 1.0f) + 1.0f / 255 + 0x1p-23f);
    }
    CHECK(weight_opacity(0) == 1.0f / 255);
    CHECK(weight_opacity(1) == 1);
}

TEST_CASE("A strategy keeps up to 65535 vertices of either side, and its index among all is a number of its own") {
    Numbers numbers(5);
    for (int i = 0; i < 10000; ++i) {
        const uint32_t s = numbers.index(65536), t = numbers.index(65536);
        const Strategy strategy = Strategy::make(s, t);
        REQUIRE((strategy.s() == s && strategy.t() == t));
    }
    std::set<uint32_t> all;
    for (uint32_t k = 1; k <= 200; ++k)
        for (uint32_t s = 0; s <= k; ++s) all.insert(strategy_index(Strategy::make(s, k + 1 - s)));
    CHECK(all.size() == strategy_count(200));
    CHECK(*all.rbegin() + 1 == strategy_count(200));
}

TEST_CASE("Vertices of connections keep positions, throughput and sums exactly, and directions to 5e-7") {
    Numbers numbers(6);
    std::vector<Vec3f> directions = corner_directions();
    for (int i = 0; i < 20000; ++i) directions.push_back(numbers.unit());
    BidirectionalVertex v = {};
    v.scattering.bsdf.type = BsdfType::rough_conductor;
    for (const Vec3f d : directions) {
        v.point.p = any_vector(numbers);
        v.offset = numbers.magnitude(-20, 10);
        v.scattering.ng = directions[numbers.index(uint32_t(directions.size()))];
        v.scattering.frame = frame_from_normal(v.scattering.ng);
        v.scattering.wi_world = -d;
        v.sums = {any_float(numbers), any_float(numbers)};
        Subpath<BidirectionalMis> path = {};
        path.direction = d;
        path.depth = 3;
        path.throughput = any_vector(numbers);
        const ConnectionVertex<BidirectionalMis> item = pack_connection_vertex(v, path, 5);
        REQUIRE((same_bits(item.front.p, v.point.p) && same_bits(item.throughput, path.throughput)));
        REQUIRE((same_bits(item.sum0, v.sums.dvcm) && same_bits(item.front.sum1, v.sums.dvc)));
        REQUIRE(norm(Exact3(octahedral_decode(item.d)) - Exact3(d)) <= 5e-7);
        REQUIRE(norm(Exact3(octahedral_decode(item.front.ng)) - Exact3(v.scattering.ng)) <= 5e-7);
        REQUIRE(norm(Exact3(octahedral_decode(item.n)) - Exact3(v.scattering.frame.n)) <= 5e-7);
    }
}
