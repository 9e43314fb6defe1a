// libs: ambilux_core ambilux_transport
// timeout: 200
// Scattering in world space: sides, shading normals, two-sided materials, bump and normal maps.
#include <cstdio>

#include "tests/support/bsdf_cases.h"
#include "tests/support/catch.h"
#include "tests/support/chi_square.h"
#include "transport/surface_scattering.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features F = kAllFeatures;
constexpr TransportMode kModes[] = {TransportMode::radiance, TransportMode::importance};

BsdfRecord diffuse(Rgb reflectance) { return bsdf_record(Textured<Diffuse>{{{reflectance, -1}}, {}}); }

/// A scene of one shape whose material can be set; enough for make_scattering.
struct OneSurface {
    Shape shape = {};
    Material material = {};
    BsdfRecord bsdfs[2] = {};
    Texture texture = {};
    std::vector<Vec4f> texels;
    SceneView view = {};

    OneSurface() {
        shape.material = 0;
        material = {0, 0, 0, {1, -1}};
        for (BsdfRecord& b : bsdfs) b = diffuse({1, 1, 1});
    }
    OneSurface(const OneSurface&) = delete;

    const SceneView& scene() {
        view.shapes = &shape;
        view.materials = &material;
        view.bsdfs = bsdfs;
        view.textures = &texture;
        view.texels = reinterpret_cast<const uint8_t*>(texels.data());
        return view;
    }
    /// Bilinear float image with (s,t) = (u,v).
    template <typename Function>
    void set_texture(uint32_t size, Function f) {
        texture = {};
        texture.type = TextureType::bitmap;
        texture.format = TexelFormat::rgba32f;
        texture.wrap = WrapMode::clamp;
        texture.filter = TextureFilter::bilinear;
        texture.width = texture.height = size;
        texture.to_uv[0][0] = texture.to_uv[1][1] = 1;
        texels.clear();
        for (uint32_t y = 0; y < size; ++y)
            for (uint32_t x = 0; x < size; ++x) {
                const Rgb c = f((x + 0.5f) / size, (y + 0.5f) / size);
                texels.push_back({c.x, c.y, c.z, 1});
            }
    }
};

Vec3f random_direction(uint32_t sequence, uint32_t i) {
    const Vec4f u = uniform(sequence, i);
    return square_to_sphere({u.x, u.y});
}

SurfacePoint point_with(Vec3f ng, Vec3f ns) {
    SurfacePoint p = {};
    p.ng = ng;
    p.ns = ns;
    p.uv = {0.5f, 0.5f};
    const Frame f = frame_from_normal(ng);
    p.dpdu = f.s * 2.0f;
    p.dpdv = f.t * 3.0f;
    return p;
}

/// Geometric normal, and a shading normal up to `degrees` off.
SurfacePoint random_point(uint32_t i, float degrees) {
    const Vec4f u = uniform(11, i);
    const Vec3f ng = square_to_sphere({u.x, u.y});
    const Vec3f tilt = square_to_cone({u.z, u.w}, 1 - std::cos(degrees_to_radians(degrees)));
    return point_with(ng, normalize(frame_from_normal(ng).to_world(tilt)));
}

/// Rough and smooth, one- and two-sided records.
std::vector<BsdfRecord> records() {
    const ParamRgb white = {{1, 1, 1}, -1};
    const ParamFloat alpha_u = {0.3f, -1}, alpha_v = {0.6f, -1};
    const Rgb color = {0.9f, 0.5f, 0.2f};
    return {diffuse(color),
            bsdf_record(Textured<RoughConductor>{{white, alpha_u, alpha_v},
                                                 {{0.2f, 0.9f, 1.1f}, {3.9f, 2.4f, 2.1f}, Microfacets::ggx, 1}}),
            bsdf_record(Textured<RoughDielectric>{{white, white, alpha_u, alpha_v}, {1.5f, Microfacets::ggx, 1}}),
            bsdf_record(Textured<Dielectric>{{white, white}, {1.5f}}),
            bsdf_record(Textured<Plastic>{{{color, -1}, white}, {1.5f, fresnel_diffuse_reflectance(1.5f), 0.5f, 0}})};
}

double relative_difference(Rgb a, Rgb b) {
    double worst = 0;
    for (int c = 0; c < 3; ++c)
        worst = std::max(worst, std::fabs(double(a[c]) - b[c]) /
                                    std::max({std::fabs(double(a[c])), std::fabs(double(b[c])), 1e-20}));
    return worst;
}

bool same_side(Vec3f w, Vec3f ng, Vec3f ns) { return (dot(ng, w) > 0) == (dot(ns, w) > 0); }

}  // namespace

TEST_CASE("B1: a subpath's throughput factor is scatter_eval/scatter_pdf, for random normals, both modes") {
    OneSurface surface;
    int compared = 0, delta = 0;
    double worst_pdf = 0, worst_weight = 0;
    for (const BsdfRecord& record : records())
        for (uint32_t two_sided : {0u, 1u}) {
            if (two_sided && (record.type == BsdfType::dielectric || record.type == BsdfType::rough_dielectric))
                continue;
            surface.bsdfs[0] = record;
            surface.material.two_sided = two_sided;
            for (uint32_t i = 0; i < 4000; ++i) {
                const SurfacePoint p = random_point(i, 60);
                const Scattering s = make_scattering<F>(surface.scene(), p, random_direction(12, i));
                for (TransportMode mode : kModes) {
                    ScatterSample out;
                    if (!scatter_sample<F>(s, uniform3(13, i), mode, out)) continue;
                    CHECK_FALSE((!same_side(out.wo, s.ng, s.frame.n) || !same_side(s.wi_world, s.ng, s.frame.n)));
                    if (out.flags & kScatterDelta) {
                        ++delta;
                        continue;
                    }
                    // wo comes back through the frame with rounding, which moves both value and pdf of these lobes by
                    // 1e-6.
                    const float pdf = scatter_pdf<F>(s, out.wo);
                    const double cosine = std::min(std::fabs(dot(s.frame.n, out.wo)), std::fabs(dot(s.ng, out.wo)));
                    if (cosine < 1e-3) continue;
                    worst_pdf = std::max(worst_pdf, std::fabs(double(pdf) - out.pdf_sa) / pdf);
                    worst_weight =
                        std::max(worst_weight, relative_difference(out.weight, scatter_eval<F>(s, out.wo, mode) / pdf));
                    ++compared;
                }
            }
        }
    std::printf("B1: %d comparisons, pdf %.2g, weight %.2g\n", compared, worst_pdf, worst_weight);
    CHECK(compared > 15000);
    CHECK(delta > 1000);
    CHECK(worst_pdf < 3e-4);
    CHECK(worst_weight < 3e-4);
}

TEST_CASE("B3: one predicate: light leaks carry nothing in either mode, whichever way the pair is walked") {
    OneSurface surface;
    int blocked = 0, open = 0, wrong = 0;
    for (const BsdfRecord& record : records()) {
        surface.bsdfs[0] = record;
        for (uint32_t i = 0; i < 5000; ++i) {
            const SurfacePoint p = random_point(i, 85);
            const Vec3f a = random_direction(21, i), b = random_direction(22, i);
            const Scattering forward = make_scattering<F>(surface.scene(), p, a),
                             back = make_scattering<F>(surface.scene(), p, b);
            const bool agree = same_side(a, p.ng, p.ns) && same_side(b, p.ng, p.ns);
            for (TransportMode mode : kModes) {
                const bool f = !is_zero(scatter_eval<F>(forward, b, mode)),
                           g = !is_zero(scatter_eval<F>(back, a, mode));
                if (!agree) wrong += f || g;
                // Where nothing is blocked, light goes both ways or neither; tiny values may vanish in one direction
                // only.
                if (agree && f != g)
                    wrong += max_component(scatter_eval<F>(f ? forward : back, f ? b : a, mode)) > 1e-12f;
                (agree ? open : blocked)++;
            }
            ScatterSample out;
            if (!same_side(a, p.ng, p.ns))
                wrong += scatter_sample<F>(forward, uniform3(23, i), TransportMode::radiance, out);
        }
    }
    CHECK(wrong == 0);
    CHECK(blocked > 10000);
    CHECK(open > 5000);
}

TEST_CASE("B1, B5: with shading normals, importance from wi to wo is the adjoint of radiance from wo to wi") {
    // Both subpaths carry the same light along the same path: f_rad(wo→wi)·|wi·ns| / |wi·ng| =
    // f_imp(wi→wo)·|wo·ns|·factor / |wo·ng| (Veach 1997, equation 5.17: scattering with the cosines of the geometric
    // normal is what the adjoint is defined by).
    OneSurface surface;
    double worst = 0;
    int compared = 0;
    for (const BsdfRecord& record : records())
        for (uint32_t two_sided : {0u, 1u}) {
            if (two_sided && (record.type == BsdfType::dielectric || record.type == BsdfType::rough_dielectric))
                continue;
            surface.bsdfs[0] = record;
            surface.material.two_sided = two_sided;
            for (uint32_t i = 0; i < 5000; ++i) {
                const SurfacePoint p = random_point(i, 60);
                const Vec3f wi = random_direction(31, i), wo = random_direction(32, i);
                const Scattering light = make_scattering<F>(surface.scene(), p, wi),
                                 eye = make_scattering<F>(surface.scene(), p, wo);
                const Rgb importance = scatter_eval<F>(light, wo, TransportMode::importance) / std::fabs(dot(p.ng, wo));
                const Rgb radiance = scatter_eval<F>(eye, wi, TransportMode::radiance) / std::fabs(dot(p.ng, wi));
                if (max_component(radiance) < 1e-6f && max_component(importance) < 1e-6f) continue;
                // Cosines near zero hold few digits, at facets of a refraction too (1-F there goes with the cosine).
                const double cosines[] = {dot(p.ng, wi), dot(p.ng, wo), dot(p.ns, wi), dot(p.ns, wo)};
                if (std::any_of(std::begin(cosines), std::end(cosines), [](double c) { return std::fabs(c) < 0.01; }))
                    continue;
                if (cosines[0] * cosines[1] < 0) {
                    const Vec3f m = normalize(wi + wo * (cosines[0] > 0 ? 1.5f : 1 / 1.5f));
                    if (std::min(std::fabs(dot(m, wi)), std::fabs(dot(m, wo))) < 0.03f) continue;
                }
                worst = std::max(worst, relative_difference(importance, radiance));
                ++compared;
            }
        }
    std::printf("adjoint with shading normals: %d pairs, %.2g\n", compared, worst);
    CHECK(compared > 3000);
    CHECK(worst < 1e-3);
}

TEST_CASE("The factor is 1 where normals agree, and pdfs never contain it") {
    OneSurface surface;
    surface.bsdfs[0] = records()[1];
    for (uint32_t i = 0; i < 500; ++i) {
        const SurfacePoint p = random_point(i, 0);
        const Vec3f wi = random_direction(41, i), wo = random_direction(42, i);
        const Scattering s = make_scattering<F>(surface.scene(), p, wi);
        CHECK(relative_difference(scatter_eval<F>(s, wo, TransportMode::importance),
                                  scatter_eval<F>(s, wo, TransportMode::radiance)) < 1e-5);
        const SurfacePoint bent = random_point(i, 50);
        const Scattering a = make_scattering<F>(surface.scene(), bent, wi),
                         b = make_scattering<F>(surface.scene(), bent, wo);
        CHECK(scatter_pdf<F>(a, wo) == bsdf_pdf<F>(a.bsdf, a.wi, a.frame.to_local(wo), TransportMode::radiance));
        const BsdfValue value = scatter_evaluate<F>(a, wo, TransportMode::radiance);
        if (is_zero(value.value)) continue;
        CHECK(value.pdf_sa == scatter_pdf<F>(a, wo));
        CHECK(value.pdf_reverse_sa == Approx(scatter_pdf<F>(b, wi)).epsilon(1e-4));
    }
}

TEST_CASE("scatter_sample in importance mode estimates the integral of scatter_eval") {
    // Mean weight against an integral over the sphere by uniform directions: tests factor, predicate and pdf together.
    // Directions within 0.05 of the shading plane are left out of both: the factor has no finite variance there.
    OneSurface surface;
    for (const BsdfRecord& record : {records()[0], records()[1], records()[2]}) {
        surface.bsdfs[0] = record;
        for (uint32_t k = 0; k < 6; ++k) {
            const SurfacePoint p = random_point(k + 100, 40);
            const Vec3f wi = normalize(p.ng + p.ns + random_direction(51, k) * 0.7f);
            const Scattering s = make_scattering<F>(surface.scene(), p, wi);
            for (TransportMode mode : kModes) {
                const int n = 200000;
                double a = 0, a2 = 0, b = 0, b2 = 0;
                for (int i = 0; i < n; ++i) {
                    ScatterSample out;
                    const auto inside = [&](Vec3f w) { return std::fabs(dot(s.frame.n, w)) > 0.05f; };
                    const double x =
                        scatter_sample<F>(s, uniform3(52 + k, i), mode, out) && inside(out.wo) ? out.weight.x : 0;
                    const Vec4f u = uniform(62 + k, i);
                    const Vec3f w = square_to_sphere({u.x, u.y});
                    const double y = inside(w) ? scatter_eval<F>(s, w, mode).x * 4 * double(kPi) : 0;
                    a += x, a2 += x * x, b += y, b2 += y * y;
                }
                a /= n, b /= n, a2 = a2 / n - a * a, b2 = b2 / n - b * b;
                const double error = std::sqrt((a2 + b2) / n);
                INFO("type " << int(record.type) << " mode " << int(mode) << ": " << a << " against " << b << " +- "
                             << error);
                CHECK(std::fabs(a - b) < 4.2 * error);
                CHECK(error < 0.02 * (1 + a));
            }
        }
    }
}

TEST_CASE(
    "Two-sided: from behind the back BSDF is used in the flipped frame; one-sided surfaces are black from behind") {
    OneSurface surface;
    surface.bsdfs[0] = diffuse({0.5f, 0, 0});
    surface.bsdfs[1] = diffuse({0, 0.25f, 0});
    surface.material = {0, 1, 1, {1, -1}};
    const SurfacePoint p = point_with({0, 0, 1}, {0, 0, 1});
    const Vec3f up = direction(0.6f), up2 = direction(0.8f, 3), down = -up, down2 = -up2;
    const Scattering front = make_scattering<F>(surface.scene(), p, up),
                     back = make_scattering<F>(surface.scene(), p, down);
    CHECK_FALSE(front.flipped);
    CHECK(back.flipped);
    CHECK(back.wi.z == Approx(0.6f));
    CHECK(scatter_eval<F>(front, up2, TransportMode::radiance).x == Approx(0.5f * kInvPi * 0.8f));
    CHECK(scatter_eval<F>(back, down2, TransportMode::radiance).y == Approx(0.25f * kInvPi * 0.8f));
    CHECK(is_zero(scatter_eval<F>(front, down2, TransportMode::radiance)));
    CHECK(is_zero(scatter_eval<F>(back, up2, TransportMode::radiance)));
    ScatterSample s;
    REQUIRE(scatter_sample<F>(back, {0.5f, 0.5f, 0.2f}, TransportMode::radiance, s));
    CHECK(s.wo.z < 0);
    surface.material = {0, 0, 0, {1, -1}};
    CHECK_FALSE(scatter_sample<F>(make_scattering<F>(surface.scene(), p, down), {0.5f, 0.5f, 0.2f},
                                  TransportMode::radiance, s));
}

TEST_CASE("Anisotropic frames follow dpdu") {
    OneSurface surface;
    SurfacePoint p = point_with({0, 0, 1}, normalize({0.1f, 0.2f, 1}));
    p.dpdu = {0, 5, 1};
    const Scattering s = make_scattering<F>(surface.scene(), p, {0, 0, 1});
    CHECK(dot(s.frame.s, s.frame.n) == Approx(0).margin(1e-6));
    CHECK(length(s.frame.s - normalize(p.dpdu - p.ns * dot(p.ns, p.dpdu))) < 1e-6f);
    CHECK(length(cross(s.frame.n, s.frame.s) - s.frame.t) < 1e-6f);
    p.dpdu = {0, 0, 0};  // undefined: any frame, but a frame
    CHECK(length(make_scattering<F>(surface.scene(), p, {0, 0, 1}).frame.s) == Approx(1));
}

TEST_CASE("Normal map: texel 2c-1 in the frame of dpdu") {
    OneSurface surface;
    const Vec3f local = normalize({0.3f, -0.2f, 0.9f});
    surface.set_texture(4, [&](float, float) { return (local + splat(1)) * 0.5f; });
    surface.bsdfs[0].normal_map = 0;
    SurfacePoint p = point_with({0, 1, 0}, {0, 1, 0});
    p.dpdu = {2, 0, 0};
    const Scattering s = make_scattering<F>(surface.scene(), p, {0, 1, 0});
    const Vec3f expected = Vec3f{1, 0, 0} * local.x + cross({0, 1, 0}, {1, 0, 0}) * local.y + Vec3f{0, 1, 0} * local.z;
    CHECK(length(s.frame.n - expected) < 1e-6f);
    // A grey texel holds no direction.
    surface.set_texture(4, [](float, float) { return splat(0.5f); });
    CHECK(make_scattering<F>(surface.scene(), p, {0, 1, 0}).frame.n == p.ns);
}

TEST_CASE("Bump map: the normal is that of the displaced surface") {
    // Height h(u,v) = 0.2·u - 0.1·v over a plane with dpdu = (2,0,0), dpdv = (0,0,-3): slopes by x and z by hand.
    OneSurface surface;
    surface.set_texture(16, [](float u, float v) { return splat(0.5f + 0.2f * u - 0.1f * v); });
    surface.bsdfs[0].bump_map = 0;
    surface.bsdfs[0].bump_scale = 2;
    SurfacePoint p = point_with({0, 1, 0}, {0, 1, 0});
    p.dpdu = {2, 0, 0};
    p.dpdv = {0, 0, -3};
    const Vec3f expected = normalize({-2 * 0.2f / 2, 1, 2 * -0.1f / 3});
    CHECK(length(make_scattering<F>(surface.scene(), p, {0, 1, 0}).frame.n - expected) < 1e-5f);
    // The same surface with mirrored texture coordinates, or none.
    surface.set_texture(16, [](float u, float v) { return splat(0.5f - 0.2f * u - 0.1f * v); });
    p.dpdu = {-2, 0, 0};
    CHECK(length(make_scattering<F>(surface.scene(), p, {0, 1, 0}).frame.n - expected) < 1e-5f);
    p.dpdu = p.dpdv = {0, 0, 0};
    CHECK(make_scattering<F>(surface.scene(), p, {0, 1, 0}).frame.n == p.ns);
    // Without the feature the map is not looked at.
    constexpr Features plain = {bit(BsdfType::diffuse), 0, 1, false, false, false};
    p.dpdu = {2, 0, 0};
    p.dpdv = {0, 0, -3};
    CHECK(make_scattering<plain>(surface.scene(), p, {0, 1, 0}).frame.n == p.ns);
}

TEST_CASE("B4: directions exactly in the geometric or shading plane scatter nothing and stay finite") {
    OneSurface surface;
    int invalid = 0;
    for (const BsdfRecord& record : records()) {
        surface.bsdfs[0] = record;
        for (Vec3f ns : {Vec3f{0, 0, 1}, Vec3f{0.6f, 0, 0.8f}})
            for (Vec3f wi : {Vec3f{1, 0, 0}, Vec3f{0.8f, 0, -0.6f}, Vec3f{0, 0, 1}, Vec3f{1, 0, 1e-30f},
                             Vec3f{0, 1, 1e-20f}, Vec3f{0, 1, 0}})
                for (Vec3f wo : {Vec3f{1, 0, 0}, Vec3f{-0.8f, 0, 0.6f}, -wi, Vec3f{0, -1, 1e-30f}, Vec3f{0, 0, 1}})
                    for (TransportMode mode : kModes) {
                        const Scattering s = make_scattering<F>(surface.scene(), point_with({0, 0, 1}, ns), wi);
                        const Rgb f = scatter_eval<F>(s, wo, mode);
                        invalid += !is_finite(f) || min_component(f) < 0 || !(scatter_pdf<F>(s, wo) < kInfinity);
                        if (wi.z == 0 || wo.z == 0) invalid += !is_zero(f);
                        ScatterSample out;
                        for (float u : {0.0f, 0.5f, kOneMinusEpsilon})
                            if (scatter_sample<F>(s, {u, u, u}, mode, out))
                                invalid += !is_finite(out.weight) || !is_finite(out.wo);
                    }
    }
    CHECK(invalid == 0);
}

namespace {

/// A record with rules and a normal map that tilts its normal by `degrees`.
void set_mapped(OneSurface& surface, BsdfRecord record, uint32_t rules, float degrees) {
    record.map_rules = rules;
    record.normal_map = 0;
    surface.bsdfs[0] = record;
    const float tilt = degrees_to_radians(degrees);
    surface.set_texture(
        1, [&](float, float) { return Rgb{0.5f + 0.5f * std::sin(tilt), 0.5f, 0.5f + 0.5f * std::cos(tilt)}; });
}

}  // namespace

TEST_CASE("rules of maps: both modes use one function, and their densities are each other's ways back") {
    OneSurface surface;
    int compared = 0, turned_pairs = 0;
    for (const BsdfRecord& record : records())
        for (uint32_t rules : {1u, 2u, 3u}) {
            set_mapped(surface, record, rules, 50);
            for (uint32_t i = 0; i < 4000; ++i) {
                const SurfacePoint p = random_point(i, 20);
                const Vec3f camera = random_direction(31, i), light = random_direction(32, i);
                const Scattering eye = make_scattering<F>(surface.scene(), p, camera),
                                 from = make_scattering<F>(surface.scene(), p, light);
                const BsdfValue radiance = scatter_evaluate<F>(eye, light, TransportMode::radiance),
                                importance = scatter_evaluate<F>(from, camera, TransportMode::importance);
                REQUIRE(is_zero(radiance.value) == is_zero(importance.value));
                if (is_zero(radiance.value)) continue;
                const float eta2 = importance.value.x * std::fabs(dot(p.ng, light)) /
                                   (radiance.value.x * std::fabs(dot(p.ng, camera)));
                const bool through = dot(p.ng, light) * dot(p.ng, camera) < 0;
                if (!through) REQUIRE(eta2 == Approx(1).epsilon(2e-3));
                REQUIRE(radiance.pdf_sa == Approx(importance.pdf_reverse_sa).epsilon(2e-3));
                REQUIRE(radiance.pdf_reverse_sa == Approx(importance.pdf_sa).epsilon(2e-3));
                ++compared;
                turned_pairs += turns_for(eye, camera);
            }
        }
    CHECK(compared > 5000);
    CHECK(turned_pairs > 100);
}

TEST_CASE("rules of maps: a sample's weight is value over density, and all that is scattered is sampled, both modes") {
    OneSurface surface;
    for (const BsdfRecord& record : {records()[0], records()[1]})
        for (TransportMode mode : kModes) {
            set_mapped(surface, record, kTurnNormals | kShadowBumps, 50);
            const SurfacePoint p = point_with({0, 0, 1}, {0, 0, 1});
            for (float cosine : {0.9f, 0.3f, 0.1f})
                for (float side : {-1.0f, 1.0f}) {
                    const Vec3f wi = {side * std::sqrt(1 - cosine * cosine), 0, cosine};
                    const Scattering s = make_scattering<F>(surface.scene(), p, wi);
                    double sampled = 0, sampled2 = 0, seen = 0, seen2 = 0, mass = 0, mass2 = 0;
                    const uint32_t n = 40000;
                    for (uint32_t i = 0; i < n; ++i) {
                        ScatterSample out;
                        if (scatter_sample<F>(s, uniform3(41, i), mode, out)) {
                            const BsdfValue v = scatter_evaluate<F>(s, out.wo, mode);
                            if (v.value.x > 1e-6f) {
                                REQUIRE(out.weight.x == Approx(v.value.x / v.pdf_sa).epsilon(1e-3));
                                REQUIRE(out.pdf_sa == Approx(v.pdf_sa).epsilon(1e-3));
                            }
                            sampled += out.weight.x, sampled2 += sqr(double(out.weight.x));
                        }
                        const BsdfValue v = scatter_evaluate<F>(s, random_direction(42, i), mode);
                        const double x = v.value.x * 4 * M_PI, m = is_zero(v.value) ? 0 : v.pdf_sa * 4 * M_PI;
                        seen += x, seen2 += x * x, mass += m, mass2 += m * m;
                    }
                    const auto error = [&](double sum, double squares) {
                        return std::sqrt(std::max(squares / n - sum / n * sum / n, 0.0) / n);
                    };
                    INFO(name_of(record.type) << " mode " << int(mode) << " cosine " << side * cosine);
                    CHECK(std::fabs(sampled - seen) / n <
                          4.5 * std::hypot(error(sampled, sampled2), error(seen, seen2)) + 1e-6);
                    CHECK(mass / n < 1 + 4.5 * error(mass, mass2));
                }
        }
}

TEST_CASE("rules of maps: the normal turns towards the camera, and bumps shadow by the published term") {
    OneSurface surface;
    set_mapped(surface, records()[0], kTurnNormals | kShadowBumps, 50);
    const SurfacePoint p = point_with({0, 0, 1}, {0, 0, 1});
    const float t = degrees_to_radians(50);
    // From behind the normal, as seen without the rule.
    const Vec3f camera = normalize(Vec3f{-2, 0, 0.5f}), light = normalize(Vec3f{-0.5f, 0.3f, 1});
    const Scattering s = make_scattering<F>(surface.scene(), p, camera);
    CHECK(dot(s.frame.n, camera) < 0);
    const Vec3f turned_n = {-std::sin(t), 0, std::cos(t)};
    const float tan2 = (1 - sqr(light.z)) / sqr(light.z), alpha2 = min(0.125f * sqr(std::tan(t)), 1.0f);
    const float shadow = 2 / (1 + std::sqrt(1 + alpha2 * tan2));
    const BsdfValue v = scatter_evaluate<F>(s, light, TransportMode::radiance);
    CHECK(v.value.x == Approx(0.9 / M_PI * dot(turned_n, light) * shadow).epsilon(1e-4));
    set_mapped(surface, records()[0], kTurnNormals, 50);
    CHECK(scatter_evaluate<F>(make_scattering<F>(surface.scene(), p, camera), light, TransportMode::radiance).value.x ==
          Approx(0.9 / M_PI * dot(turned_n, light)).epsilon(1e-5));
    set_mapped(surface, records()[0], 0, 50);
    CHECK(is_zero(scatter_eval<F>(make_scattering<F>(surface.scene(), p, camera), light, TransportMode::radiance)));
}

TEST_CASE("rules of maps: what is left of a vertex in a queue makes the same vertex") {
    OneSurface surface;
    for (const BsdfRecord& record : records()) {
        set_mapped(surface, record, kTurnNormals | kShadowBumps, 40);
        for (uint32_t two_sided : {0u, 1u}) {
            surface.material.two_sided = two_sided;
            for (uint32_t i = 0; i < 2000; ++i) {
                const SurfacePoint p = random_point(i, 30);
                const Vec3f w = random_direction(51, i);
                const Scattering a = make_scattering<F>(surface.scene(), p, w),
                                 b = scattering_of<F>(surface.scene(), parts_of(a), w);
                REQUIRE(a.map_rules == b.map_rules);
                REQUIRE(length(a.base - b.base) < 2e-6f);
                if (std::fabs(dot(frame_from_normal(b.base).s, a.frame.n)) > 0.99f) continue;
                REQUIRE(length(a.frame.s - b.frame.s) < 2e-5f);
                REQUIRE(length(a.frame.t - b.frame.t) < 2e-5f);
            }
        }
        surface.material.two_sided = 0;
    }
}
