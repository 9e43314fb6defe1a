// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// What queues keep of a vertex is what connections are made of, and tells beforehand which of them bring nothing.
#include <bit>
#include <cmath>
#include <cstring>
#include <memory>

#include "accel/cwbvh.h"
#include "queues/layout.h"
#include "stages/vertex_queues.h"
#include "tests/support/bidirectional_images.h"
#include "transport/subpath/connection.h"

using namespace ambilux;

namespace {

/// Reflectance of a diffuse BSDF; of others one that is not 0.
Rgb reflectance_of(const Bsdf& b) { return b.type == BsdfType::diffuse ? b.as<Diffuse>().reflectance : splat(1); }

bool same_parameters(const Bsdf& a, const Bsdf& b) {
    return a.type == b.type && a.tables == b.tables &&
           BsdfModels::visit<BsdfModels::kAll>(uint32_t(a.type), false, [&](auto model) {
               using Model = typename decltype(model)::type;
               const auto x = a.as<Model>(), y = b.as<Model>();
               return std::memcmp(&x, &y, sizeof x) == 0;
           });
}

/// To the bit, in all that connections ask of an end.
void check_rounded(const BidirectionalEnd& a, const BidirectionalEnd& b) {
    const auto same = [](Vec3f x, Vec3f y) { return std::memcmp(&x, &y, sizeof x) == 0; };
    const BidirectionalVertex &v = a.vertex, &w = b.vertex;
    const Scattering &s = v.scattering, &t = w.scattering;
    REQUIRE((a.depth == b.depth && same(a.throughput, b.throughput) && v.first == w.first));
    REQUIRE((same(v.point.p, w.point.p) && same(v.point.ng, w.point.ng) && v.offset == w.offset));
    REQUIRE((v.sums.dvcm == w.sums.dvcm && v.sums.dvc == w.sums.dvc));
    REQUIRE((same(s.frame.s, t.frame.s) && same(s.frame.t, t.frame.t) && same(s.frame.n, t.frame.n)));
    REQUIRE((same(s.ng, t.ng) && same(s.wi_world, t.wi_world) && same(s.wi, t.wi) && s.map_rules == t.map_rules));
    REQUIRE((same_parameters(s.bsdf, t.bsdf) && s.bsdf.coat == t.bsdf.coat));
}

using BidirectionalSubpath = Subpath<BidirectionalMis>;

/// A ray along `d` of `depth` segments that brings `throughput`.
BidirectionalSubpath ray_along(Vec3f d, uint32_t depth, Rgb throughput = {1, 1, 1}) {
    BidirectionalSubpath path = {};
    path.direction = d;
    path.depth = depth;
    path.throughput = throughput;
    return path;
}

Rules<BidirectionalMis> all_rules() {
    Rules<BidirectionalMis> rules = {};
    rules.mis.strategies = kAllStrategies;
    rules.mis.light_subpaths = rules.mis.connections = 1.0f;
    rules.max_depth = kMaxDepth;
    rules.rr_depth = ~0u;
    rules.count_hits = rules.count_environment = rules.next_event = rules.splat = rules.connect = true;
    return rules;
}

/// Both with throughput 1.
bool connects(const Rules<BidirectionalMis>& rules, const BidirectionalVertex& y, const BidirectionalVertex& z) {
    Candidate<BidirectionalMis> c;
    return connection<kAllFeatures>(rules, {z, {1, 1, 1}, 1}, {y, {1, 1, 1}, 1}, c) && !is_zero(c.value);
}

}  // namespace

TEST_CASE("Pairs that are turned down by geometry and types of BSDFs bring no light") {
    for (const char* name : {"cornell", "glass", "materials", "textured"}) {
        const Scene scene = project_scene(name, 32, 32);
        const CwbvhAccel accel(scene);
        const SceneView view = scene.view();
        const auto at_random = [&](uint32_t i, Stream stream, BidirectionalVertex& v) {
            const RngKey key = {5, i, 0, stream};
            const Vec4f u = random_floats(key, 0);
            // Through the middle of the scene.
            const Vec3f from = scene.bounds_center + square_to_sphere({u.x, u.y}) * scene.bounds_radius,
                        to = scene.bounds_center + square_to_sphere({u.z, u.w}) * (0.4f * scene.bounds_radius);
            const Vec3f d = normalize(to - from);
            Hit hit;
            if (!accel.tracer().closest<kAllFeatures>(view, {from, kInfinity, d, 0}, hit)) return false;
            v.point = surface_at<kAllFeatures>(view, hit.prim, hit.u, hit.v);
            v.offset = ray_offset(v.point.p, v.point.p_error, v.point.ng);
            v.scattering = make_scattering<kAllFeatures>(view, v.point, -d);
            v.sums = {1, 1};
            v.first = false;
            return bsdf_is_smooth(v.scattering.bsdf);
        };
        const Rules<BidirectionalMis> rules = all_rules();
        uint32_t pairs = 0, turned_down = 0, lit = 0;
        for (uint32_t i = 0; i < 20000; ++i) {
            BidirectionalVertex y, z;
            if (!at_random(i, Stream::light, y) || !at_random(i, Stream::eye, z)) continue;
            ++pairs;
            const Vec3f w = z.point.p - y.point.p, wi = normalize(w);
            const bool brings =
                !in_plane(z, w) &&
                !is_zero(scatter_evaluate<kAllFeatures>(y.scattering, wi, TransportMode::importance).value) &&
                !is_zero(scatter_evaluate<kAllFeatures>(z.scattering, -wi, TransportMode::radiance).value);
            lit += brings;
            turned_down += !may_connect(y, z);
            REQUIRE((may_connect(y, z) || !brings));
            REQUIRE((brings || !connects(rules, y, z)));
            if (std::fabs(dot(y.scattering.ng, w)) < 1e-6f * length(w))
                continue;  // the side may be another by rounding
            REQUIRE(may_connect(pack_connection_vertex(y, ray_along(-y.scattering.wi_world, 2), kNone).front, z) ==
                    may_connect(y, z));
        }
        INFO(name << ": " << pairs << " pairs, " << turned_down << " turned down, " << lit << " with light");
        CHECK(pairs > 1000);
        CHECK(lit > 100);
        CHECK(turned_down > pairs / 4);
    }
}

TEST_CASE("A vertex that comes from a queue is the one that went in, surface, frame and BSDF") {
    constexpr Features kUntextured = {
        kAllFeatures.bsdfs, kAllFeatures.emitters, kAllFeatures.primitives, false, false, false};
    const auto same = [](Vec3f a, Vec3f b) { return a.x == b.x && a.y == b.y && a.z == b.z; };
    const auto close = [](Vec3f a, Vec3f b) {
        return length(a - b) < 1e-6f;
    };  // copies of one function round their sums of products differently
    uint32_t types = 0, behind = 0;
    for (const char* name : {"cornell", "glass", "materials", "textured"}) {
        INFO(name);
        const Scene scene = project_scene(name, 32, 32);
        const CwbvhAccel accel(scene);
        const SceneView view = scene.view();
        uint32_t vertices = 0;
        for (uint32_t i = 0; i < 20000; ++i) {
            const RngKey key = {11, i, 0, Stream::eye};
            const Vec4f u = random_floats(key, 0), t = random_floats(key, 1);
            const Vec3f from = scene.bounds_center + square_to_sphere({u.x, u.y}) * scene.bounds_radius,
                        to = scene.bounds_center + square_to_sphere({u.z, u.w}) * (0.4f * scene.bounds_radius);
            const Vec3f d = normalize(to - from);
            Hit hit;
            if (!accel.tracer().closest<kAllFeatures>(view, {from, kInfinity, d, 0}, hit)) continue;
            const uint32_t depth = 1 + i % 2;
            const BidirectionalVertex v = vertex_with<kAllFeatures, BidirectionalMis>(
                view, d, depth, surface_at<kAllFeatures>(view, hit.prim, hit.u, hit.v), {t.z, t.w});
            const Bsdf& f = v.scattering.bsdf;
            const bool diffuse = f.type == BsdfType::diffuse;
            ++vertices;
            behind += v.scattering.flipped;
            types |= bit(f.type);
            // What is common to vertices of both sides, `reflectance` that of a diffuse one, which has no
            // tangents and no record.
            const auto check = [&](const auto& item, const BidirectionalVertex& back, Rgb reflectance) {
                const Scattering &a = v.scattering, &b = back.scattering;
                const Bsdf& g = b.bsdf;
                REQUIRE((item.bits().depth() == depth && path_of(item) == 7 &&
                         item.bits().template diffuse<kAllFeatures>() == diffuse));
                REQUIRE((back.first == v.first && back.sums.dvcm == v.sums.dvcm && back.sums.dvc == v.sums.dvc &&
                         same(back.point.p, v.point.p)));
                REQUIRE((close(back.point.ng, v.point.ng) ||
                         close(-back.point.ng, v.point.ng)));  // its side does not matter
                REQUIRE((close(a.ng, b.ng) && close(a.frame.n, b.frame.n) && close(a.wi_world, b.wi_world) &&
                         std::fabs(a.wi.z - b.wi.z) < 1e-6f && f.type == g.type));
                if (diffuse) {
                    REQUIRE(same(g.as<Diffuse>().reflectance, reflectance));
                    return;
                }
                REQUIRE((close(a.frame.s, b.frame.s) && close(a.frame.t, b.frame.t) && close(a.wi, b.wi)));
                REQUIRE((a.record == b.record && a.flipped == b.flipped && same_parameters(f, g)));
            };
            const Subpath<UnidirectionalMis> unidirectional = {{}, d, {1, 2, 3}, {0.5f}, depth, 1.0f, false, {}};
            const VertexItem<UnidirectionalMis> without_sums =
                pack_vertex(vertex_with<kAllFeatures, UnidirectionalMis>(
                                view, d, depth, surface_at<kAllFeatures>(view, hit.prim, hit.u, hit.v), {0.5f}),
                            unidirectional, 7);
            const bool textured = scene.features.textures || scene.features.bumps;
            const BidirectionalSubpath path = ray_along(d, depth, {1, 2, 3});
            const VertexItem<BidirectionalMis> eye = pack_vertex(v, path, 7);
            REQUIRE(same(eye.throughput, {1, 2, 3}));
            // That of a path tracer, which asks for no sums, is the same without them.
            VertexItem<BidirectionalMis> expected = eye;
            expected.sum0 = expected.sum1 = 0.0f;
            REQUIRE(std::memcmp(&expected, &without_sums, sizeof(expected)) == 0);
            const auto vertex_of = [&](const BidirectionalEnd& end, Rgb throughput) {
                REQUIRE((end.depth == depth && same(end.throughput, throughput)));
                return end.vertex;
            };
            const BidirectionalVertex exact = vertex_of(unpack_end<kAllFeatures>(view, eye), {1, 2, 3});
            REQUIRE((exact.offset == v.offset && same(exact.scattering.wi_world, v.scattering.wi_world) &&
                     same(exact.scattering.ng, v.scattering.ng) &&
                     same(exact.scattering.frame.n, v.scattering.frame.n)));
            check(eye, exact, reflectance_of(f));
            if (!textured) check(eye, vertex_of(unpack_end<kUntextured>(view, eye), {1, 2, 3}), reflectance_of(f));
            const ConnectionVertex<BidirectionalMis> light = pack_connection_vertex(v, path, 7);
            REQUIRE(same(light.throughput, diffuse ? Rgb{1, 2, 3} * reflectance_of(f) : Rgb{1, 2, 3}));
            const BidirectionalVertex back = vertex_of(unpack_end<kAllFeatures>(view, light), light.throughput);
            REQUIRE((back.offset >= v.offset && back.offset <= v.offset * (1.0f + 1.0f / 128.0f)));
            check(light, back, {1, 1, 1});
            check_rounded(rounded_end<kAllFeatures>(view, v, path), unpack_end<kAllFeatures>(view, light));
            if (!textured) check_rounded(rounded_end<kUntextured>(view, v, path), unpack_end<kUntextured>(view, light));
            if (!textured) check(light, vertex_of(unpack_end<kUntextured>(view, light), light.throughput), {1, 1, 1});
        }
        CHECK(vertices > 1000);
    }
    CHECK(std::popcount(types) >= 5);
    CHECK(behind > 0);
}

TEST_CASE("Queues hold of a vertex what its BSDF needs, and give it back") {
    constexpr Features kPlain = {bit(BsdfType::diffuse), 0, 1, false, false, false},
                       kUntextured = {kAllFeatures.bsdfs, 0, 1, false, false, false};
    const auto check = [](auto features, auto item) {
        constexpr Features F = decltype(features)::value;
        using Item = decltype(item);
        Layout sizes;
        sizes.queue<Item>("vertices", 3, false, Item::template lanes<F>());
        std::vector<Lane> memory(sizes.bytes() / sizeof(Lane) + 16, Lane{{~0u, ~0u, ~0u, ~0u}});
        void* start = memory.data();
        size_t room = memory.size() * sizeof(Lane);
        Layout layout(sizes, std::align(256, sizes.bytes(), start, room));
        const Queue<Item> queue = layout.queue<Item>("vertices", 3, false, Item::template lanes<F>());
        *queue.counter = layout.first_counters()[0];
        for (const bool diffuse : {true, false, true}) {
            if (!diffuse && F.bsdfs == bit(BsdfType::diffuse)) continue;
            BidirectionalVertex v = {};
            v.point.p = {1, 2, 3};
            v.scattering.bsdf.type = diffuse ? BsdfType::diffuse : BsdfType::rough_plastic;
            v.scattering.bsdf.inputs = {{{4, 5, 6}, {7, 8, 9}}, {10, 10}};
            v.scattering.wi_world = v.scattering.ng = v.scattering.frame.n = {0, 0, 1};
            v.scattering.frame.s = {1, 0, 0};
            v.scattering.record = 5;
            v.sums = {11, 12};
            const BidirectionalSubpath path = ray_along({0, 0, -1}, 3);
            if constexpr (std::is_same_v<Item, VertexItem<BidirectionalMis>>)
                item = pack_vertex(v, path, 13);
            else
                item = pack_connection_vertex(v, path, 13);
            const uint32_t place = push_vertex<F>(queue, item), lanes = lanes_of<F>(item);
            CHECK(lanes == (diffuse ? Item::kDiffuseLanes : Item::template lanes<F>()));
            const Item back = load_vertex<F>(queue, place);
            CHECK(std::memcmp(&back, &item, lanes * sizeof(Lane)) == 0);
        }
        CHECK(queue.counter->count == (F.bsdfs == bit(BsdfType::diffuse) ? 2 : 3));
    };
    const auto both = [&](auto features) {
        check(features, VertexItem<BidirectionalMis>{});
        check(features, ConnectionVertex<BidirectionalMis>{});
    };
    both(std::integral_constant<Features, kPlain>{});
    both(std::integral_constant<Features, kUntextured>{});
    both(std::integral_constant<Features, kAllFeatures>{});
}

TEST_CASE("A light vertex in a queue tells to which sides it scatters") {
    for (uint32_t i = 0; i < 400000; ++i) {
        const RngKey key = {9, i, 0, Stream::eye};
        const Vec4f u = random_floats(key, 0), v = random_floats(key, 1), t = random_floats(key, 2);
        Vec3f n = square_to_sphere({u.x, u.y});
        // Along edges of the octahedron and at its corners too.
        if (i % 3 == 0) n = normalize(Vec3f{i % 2 ? n.x : 0.0f, i % 4 < 2 ? n.y : 1e-4f * n.y, i % 5 ? n.z : 0.0f});
        if (!is_finite(n)) continue;
        BidirectionalVertex y = {};
        y.scattering.ng = y.scattering.frame.n = n;
        y.scattering.wi_world = square_to_sphere({t.x, t.y});
        y.offset = std::exp2(60.0f * (t.z - 0.5f));
        // A direction at `angle` above the surface, of any length.
        const Vec3f across = normalize(cross(n, square_to_sphere({v.x, v.y})));
        const float angle = 0.1f * (2.0f * u.z - 1.0f), distance = std::exp2(60.0f * (u.w - 0.5f));
        const Vec3f w = (across * std::cos(angle) + n * std::sin(angle)) * distance;
        INFO("normal " << n.x << " " << n.y << " " << n.z << ", angle " << angle << ", distance " << distance);
        const uint32_t depth = 1 + i % kMaxDepth;
        for (const BsdfType type : {BsdfType::diffuse, BsdfType::rough_plastic, BsdfType::rough_dielectric}) {
            y.scattering.bsdf.type = type;
            const ConnectionVertexFront front =
                pack_connection_vertex(y, ray_along(-y.scattering.wi_world, depth), kNone).front;
            REQUIRE(front.bits.depth() == depth);
            REQUIRE((front.bits.offset() >= y.offset && front.bits.offset() <= y.offset * (1.0f + 1.0f / 128.0f)));
            if (std::fabs(angle) < 1e-6f || std::fabs(dot(n, y.scattering.wi_world)) < 1e-6f) continue;
            REQUIRE(front.bits.reaches(octahedral_direction(front.ng), w) == may_scatter(y.scattering, w));
        }
    }
}

TEST_CASE("Points in one plane, as far as positions are known, exchange no light; points above it do") {
    const Scene scene = project_scene("cornell", 32, 32);
    const SceneView view = scene.view();
    const Rules<BidirectionalMis> rules = all_rules();
    uint32_t points = 0, pairs = 0;
    for (uint32_t i = 0; i < 20000; ++i) {
        const Vec4f u = random_floats({21, i, 0, Stream::eye}, 0);
        const uint32_t prim = i % (scene.shapes.back().first_primitive + scene.shapes.back().primitive_count);
        // Two points of one triangle, and the second one moved up.
        const auto at = [&](float a, float b) { return a + b < 1.0f ? Vec2f{a, b} : Vec2f{1.0f - a, 1.0f - b}; };
        const Vec2f p = at(u.x, u.y), q = at(u.z, u.w);
        const SurfacePoint point = surface_at<kAllFeatures>(view, prim, p.x, p.y);
        const auto vertex = [&](const SurfacePoint& x) {
            return vertex_with<kAllFeatures, BidirectionalMis>(view, -point.ng, 1, x, {1, 1});
        };
        const BidirectionalVertex z = vertex(point);
        BidirectionalVertex y = vertex(surface_at<kAllFeatures>(view, prim, q.x, q.y));
        if (is_zero(reflectance_of(z.scattering.bsdf))) continue;
        ++points;
        Candidate<BidirectionalMis> c;
        REQUIRE_FALSE(may_connect(y, z));
        REQUIRE_FALSE(connection<kAllFeatures>(rules, {z, {1, 1, 1}, 1}, {y, {1, 1, 1}, 1}, c));
        y.point.p += z.point.ng * (8.0f * z.offset);
        y.point.ng = y.scattering.ng = y.scattering.frame.n = -z.scattering.ng;
        y.scattering.wi_world = -z.scattering.wi_world;
        pairs += connects(rules, y, z);
    }
    CHECK(points > 15000);
    CHECK(pairs > points - points / 50);  // but those whose rays begin above each other
}

TEST_CASE("A ray that comes from a queue is the one that went in, with all that its subpath carries") {
    const auto same = [](Vec3f a, Vec3f b) { return a.x == b.x && a.y == b.y && a.z == b.z; };
    const auto check = [&](auto mis, Side side, const auto& path, float tmax) {
        using Items = SubpathItems<decltype(mis)>;
        const typename Items::Ray ray = Items::pack(path, side, 9, tmax);
        CHECK(path_of(ray) == 9);
        CHECK(Items::tmax(ray) == (path.depth == 1 ? tmax : kInfinity));
        const auto back = Items::unpack(ray);
        CHECK((same(back.origin, path.origin) && same(back.direction, path.direction) &&
               same(back.throughput, path.throughput)));
        CHECK((back.depth == path.depth && back.delta == path.delta && back.roulette_scale == path.roulette_scale));
        return back;
    };
    for (const uint32_t depth : {1u, 2u, kMaxDepth})
        for (const bool delta : {false, true}) {
            INFO("depth " << depth << " delta " << delta);
            const Subpath<UnidirectionalMis> alone = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10}, depth, 1.5f, delta, {}};
            const auto back = check(UnidirectionalMis{}, Side::eye, alone, 100.0f);
            if (depth > 1) CHECK(back.sums.pdf_sa == 10);
            for (const Side side : {Side::eye, Side::light}) {
                BidirectionalSubpath path = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11}, depth, 1.5f, delta, {}};
                path.start = {12, 13, 14, 15, 77, 16};
                const BidirectionalSubpath b = check(BidirectionalMis{}, side, path, 100.0f);
                // First rays of light subpaths have no sums yet; others have no start.
                if (side == Side::eye || depth > 1) CHECK((b.sums.dvcm == 10 && b.sums.dvc == 11));
                if (side == Side::eye && depth == 1) CHECK(b.start.camera_distance == 16);
                if (side == Side::light && depth == 1)
                    CHECK((b.start.inv_pdf == 12 && b.start.direction == 13 && b.start.prim == 14 &&
                           b.start.emitter == 15 && b.start.opacity_step == 77));
            }
        }
}
