// libs: ambilux_core
// Sums of any number of words through rays and vertices of queues: what they cost, and that they come back.
#include <cstring>

#include "items/vertex_items.h"
#include "queues/lane_array.h"
#include "tests/support/catch.h"
#include "tests/support/third_sum.h"

using namespace ambilux;

namespace {

/// A bidirectional model of kWords sums, of which vertices keep kKept.
template <uint32_t kWords, uint32_t kKept = kWords>
struct ManySums : BidirectionalMis {
    struct Sums {
        static constexpr uint32_t kVertexWords = kKept;
        float of[kWords];
    };
};
/// The same of a path tracer.
template <uint32_t kWords>
struct ManyPathSums : UnidirectionalMis {
    struct Sums {
        float of[kWords];
    };
};

template <class Mis>
typename Mis::Sums numbered(float first) {
    constexpr uint32_t kWords = sizeof(typename Mis::Sums) / sizeof(float);
    float words[kWords];
    for (uint32_t k = 0; k < kWords; ++k) words[k] = first + float(k);
    typename Mis::Sums sums;
    std::memcpy(&sums, words, sizeof(sums));
    return sums;
}

/// True if the first `kept` words of `a` are those of `b`, and the others 0.
template <class Sums>
bool same_words(const Sums& a, const Sums& b, uint32_t kept) {
    float x[sizeof(Sums) / sizeof(float)], y[sizeof(Sums) / sizeof(float)];
    std::memcpy(x, &a, sizeof(a));
    std::memcpy(y, &b, sizeof(b));
    for (uint32_t k = 0; k < sizeof(Sums) / sizeof(float); ++k)
        if (x[k] != (k < kept ? y[k] : 0.0f)) return false;
    return true;
}

template <class Mis>
void check_rays(uint32_t lanes) {
    using Items = SubpathItems<Mis>;
    CHECK(LaneArray<typename Items::Ray>::kLanes == lanes);
    CHECK(LaneArray<HitItem<typename Items::Ray>>::kLanes == lanes + 1);
    for (const uint32_t depth : {1u, 2u, 7u})
        for (const Side side : {Side::eye, Side::light}) {
            Subpath<Mis> path{};
            path.depth = depth;
            path.sums = numbered<Mis>(11.0f);
            if constexpr (Mis::kBidirectional) path.start = {0.5f, 0.25f, 14, 15, 16, 4.0f};
            const typename Items::Ray ray = Items::pack(path, side, 9, 100.0f);
            const Subpath<Mis> back = Items::unpack(ray);
            CHECK(Items::tmax(ray) == (depth == 1 ? 100.0f : kInfinity));
            if (depth > 1 || (Mis::kBidirectional && side == Side::eye))
                CHECK(same_words(back.sums, path.sums, ray_words<typename Mis::Sums>()));
            if constexpr (Mis::kBidirectional) {
                if (depth == 1 && side == Side::eye) CHECK(back.start.camera_distance == 4.0f);
                if (depth == 1 && side == Side::light)
                    CHECK((back.start.inv_pdf == 0.5f && back.start.direction == 0.25f && back.start.prim == 14 &&
                           back.start.emitter == 15 && back.start.opacity_step == 16));
            }
        }
}

/// `more`: lanes beyond those of BidirectionalMis.
template <class Mis>
void check_vertices(uint32_t more, uint32_t kept) {
    constexpr Features kPlain = {bit(BsdfType::diffuse), 0, 1, false, false, false};
    Vertex<Mis> v = {};
    v.point.p = {1, 2, 3};
    v.scattering.bsdf.type = BsdfType::diffuse;
    v.scattering.bsdf.inputs = {{{4, 5, 6}, {7, 8, 9}}, {10, 10}};
    v.scattering.wi_world = v.scattering.ng = v.scattering.frame.n = {0, 0, 1};
    v.sums = numbered<Mis>(11.0f);
    Subpath<Mis> path{};
    path.depth = 3;
    path.direction = {0, 0, -1};
    path.throughput = {1, 1, 1};
    const auto check = [&](const auto& item, uint32_t diffuse, uint32_t all) {
        using Item = std::decay_t<decltype(item)>;
        CHECK(Item::kDiffuseLanes == diffuse + more);
        CHECK(Item::template lanes<kPlain>() == diffuse + more);
        CHECK(Item::template lanes<kAllFeatures>() == all + more);
        CHECK(LaneArray<Item>::kLanes == all + more);
        // A diffuse vertex comes back from its lanes alone.
        Lane memory[2 * LaneArray<Item>::kLanes] = {};
        const LaneArray<Item> array = {memory, 2};
        array.store(1, item, Item::kDiffuseLanes);
        const SubpathEnd<Mis> end = unpack_end<kPlain>(SceneView{}, array.load(1, Item::kDiffuseLanes));
        CHECK(same_words(end.vertex.sums, v.sums, kept));
        CHECK((end.depth == 3 && end.vertex.point.p.z == 3.0f && end.vertex.scattering.frame.n.z == 1.0f));
    };
    check(pack_vertex(v, path, 7), 6, 8);
    check(pack_connection_vertex(v, path, 7), 4, 7);
}

}  // namespace

TEST_CASE("A third sum costs no lane of a ray and one of a vertex; those who have none pay nothing") {
    check_rays<BidirectionalMis>(4);
    check_rays<ThirdSumMis>(4);
    check_rays<UnidirectionalMis>(3);
    check_vertices<BidirectionalMis>(0, 2);
    check_vertices<ThirdSumMis>(1, 3);
    check_vertices<UnidirectionalMis>(0, 0);
}

TEST_CASE("Sums of any number come back from rays and vertices, whole lanes at a time") {
    check_rays<ManySums<1>>(4);
    check_rays<ManySums<4>>(5);
    check_rays<ManySums<7>>(5);
    check_rays<ManySums<8>>(6);
    check_rays<ManyPathSums<2>>(4);
    check_rays<ManyPathSums<5>>(4);
    check_rays<ManyPathSums<6>>(5);
    check_vertices<ManySums<1>>(0, 1);
    check_vertices<ManySums<6>>(1, 6);
    check_vertices<ManySums<7>>(2, 7);
    check_vertices<ManySums<7, 3>>(1, 3);
    check_vertices<ManyPathSums<2>>(0, 2);
}
