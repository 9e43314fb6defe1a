// libs: ambilux_scene ambilux_core
// timeout: 120
// Densities of light sampling: the same whether asked for or sampled, and the ones that samples follow.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features kAll = kAllFeatures;

/// Nearest hit of a ray with the only shape of a scene, by textbook formulas in double. t <= 0: none.
Hit intersect(const SceneView& view, Vec3f o, Vec3f d) {
    Hit hit{0, 0, 0, kNone};
    double best = std::numeric_limits<double>::infinity();
    const auto keep = [&](double t, double u, double v, uint32_t prim) {
        if (t > 1e-9 && t < best) {
            best = t;
            hit = {float(t), float(u), float(v), prim};
        }
    };
    for (uint32_t i = 0; i < view.triangle_count; ++i) {
        const Triangle& tri = view.triangles[i];
        const Vec3f p0 = view.vertices[tri.v0].p, a = view.vertices[tri.v1].p - p0, b = view.vertices[tri.v2].p - p0,
                    r = o - p0;
        const double e1[3] = {a.x, a.y, a.z}, e2[3] = {b.x, b.y, b.z}, dd[3] = {d.x, d.y, d.z}, rr[3] = {r.x, r.y, r.z};
        const auto det = [](const double* x, const double* y, const double* z) {
            return x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0]) +
                   x[2] * (y[0] * z[1] - y[1] * z[0]);
        };
        const double md[3] = {-dd[0], -dd[1], -dd[2]};
        const double full = det(e1, e2, md);
        if (full == 0) continue;
        const double u = det(rr, e2, md) / full, v = det(e1, rr, md) / full, t = det(e1, e2, rr) / full;
        if (u >= 0 && v >= 0 && u + v <= 1) keep(t, u, v, i);
    }
    for (uint32_t i = 0; i < view.quadric_count; ++i) {
        const uint32_t prim = view.triangle_count + i;
        const Quadric& q = view.quadrics[i];
        const Vec3f lo = q.to_local.point(o), ld = q.to_local.vector(d);
        const double ox = lo.x, oy = lo.y, oz = lo.z, dx = ld.x, dy = ld.y, dz = ld.z;
        if (q.type == PrimitiveType::disk) {
            const double t = -oz / dz, x = ox + t * dx, y = oy + t * dy;
            if (dz != 0 && x * x + y * y <= 1) keep(t, x, y, prim);
            continue;
        }
        const double three = q.type == PrimitiveType::sphere ? 1 : 0;
        const double a = dx * dx + dy * dy + three * dz * dz, b = ox * dx + oy * dy + three * oz * dz,
                     c = ox * ox + oy * oy + three * oz * oz - 1;
        const double root = b * b - a * c;
        if (a == 0 || root < 0) continue;
        for (double sign : {-1.0, 1.0}) {
            const double t = (-b + sign * std::sqrt(root)) / a, x = ox + t * dx, y = oy + t * dy, z = oz + t * dz;
            if (q.type == PrimitiveType::sphere) {
                const Vec2f e = octahedral_encode(normalize(Vec3f{float(x), float(y), float(z)}));
                keep(t, e.x, e.y, prim);
            } else if (z >= 0 && z <= 1) {
                keep(t, std::atan2(y, x), z, prim);
            }
        }
    }
    return hit;
}

/// Where the density has a pole whose square is not integrable, so that no quadrature would settle: 1/cos at the
/// outline of a shape sampled by area, 1/sin(theta) at the poles of an environment map. Such samples count as missed.
bool near_pole(const SceneView& view, Vec3f wi, Vec3f ng) {
    if (view.environment == kNone) return dot(ng, -wi) < 0.1f;
    return view.emitters[0].type == EmitterType::envmap && std::fabs(view.emitters[0].to_local.vector(wi).y) > 0.995f;
}

/// Density that light sampling claims for direction `wi`, of the only emitter.
double claimed_pdf(const SceneView& view, Vec3f p, Vec3f wi) {
    if (view.environment != kNone) return near_pole(view, wi, wi) ? 0 : pdf_environment_direct<kAll>(view, wi);
    const Hit hit = intersect(view, p, wi);
    if (hit.prim == kNone) return 0;
    const SurfacePoint s = surface_at<kAll>(view, hit.prim, hit.u, hit.v);
    if (is_zero(emitted_radiance<kAll>(view, view.shapes[s.shape].emitter, s, -wi)) || near_pole(view, wi, s.ng))
        return 0;
    return pdf_emitter_direct<kAll>(view, view.shapes[s.shape].emitter, p, wi, s);
}

/// Density that light sampling claims for a direction it sampled, with the surface point rebuilt from the sampled
/// position.
double claimed_pdf(const SceneView& view, Vec3f p, const EmitterSample& s) {
    if (view.environment != kNone) return pdf_environment_direct<kAll>(view, s.wi);
    Hit hit;
    if (view.triangle_count > 0) {
        hit = intersect(view, p, s.wi);
        if (hit.prim == kNone) return 0;
    } else {
        // Not by intersection: at grazing angles the density is as uncertain as the hit.
        const Quadric& q = view.quadrics[0];
        const Vec3f local = q.to_local.point(s.p);
        hit = {0, local.x, local.y, 0};
        if (q.type == PrimitiveType::sphere) {
            const Vec2f e = octahedral_encode(normalize(local));
            hit = {0, e.x, e.y, 0};
        } else if (q.type == PrimitiveType::cylinder) {
            hit = {0, atan2f(local.y, local.x), local.z, 0};
        }
    }
    return pdf_emitter_direct<kAll>(view, 0, p, s.wi, surface_at<kAll>(view, hit.prim, hit.u, hit.v));
}

/// Chi-square of sampled directions against the claimed density, over a cone around `axis` that holds the light. Also
/// checks that the density of every sample is the claimed one.
void check_density(const Scene& scene, Vec3f p, Vec3f axis, double one_minus_cos, uint32_t seed,
                   uint32_t samples = 100000) {
    const SceneView view = view_of(scene);
    const int nz = 12, nphi = 16, fine = view.triangle_count > 100 ? 48 : 100;
    const Frame frame = frame_from_normal(normalize(axis));
    std::vector<double> expected(size_t(nz * nphi), 0.0), observed(size_t(nz * nphi), 0.0);
    const double cell = one_minus_cos * 2 * M_PI / (double(nz) * fine * nphi * fine);
    for (int j = 0; j < nz * fine; ++j)
        for (int i = 0; i < nphi * fine; ++i) {
            // Jittered: outlines that run along the grid would make a regular one wrong.
            const Vec4f jitter = random(seed + 1000, uint32_t(j * nphi * fine + i));
            const double v = one_minus_cos * (j + jitter.x) / (nz * fine),
                         phi = 2 * M_PI * (i + jitter.y) / (nphi * fine), r = std::sqrt(v * (2 - v));
            const Vec3f local = {float(r * std::cos(phi)), float(r * std::sin(phi)), float(1 - v)};
            expected[size_t((j / fine) * nphi + i / fine)] += claimed_pdf(view, p, frame.to_world(local)) * cell;
        }
    double missed = samples, outside = 0;
    int different = 0, compared = 0;
    for (uint32_t i = 0; i < samples; ++i) {
        EmitterSample s;
        if (!sample_emitter_direct<kAll>(view, p, random(seed, i), s)) continue;
        if (i % 50 == 0) {
            ++compared;
            const double claimed = claimed_pdf(view, p, s);
            different += !(std::fabs(claimed - s.pdf_sa) <= 1e-4 * s.pdf_sa);
        }
        if (near_pole(view, s.wi, s.ng)) continue;
        missed -= 1;
        const Vec3f local = frame.to_local(s.wi);
        const double r2 = double(local.x) * local.x + double(local.y) * local.y;
        const double v = local.z > 0 ? r2 / (1 + std::sqrt(std::max(0.0, 1 - r2))) : 1.0 - local.z;
        const int j = int(v / one_minus_cos * nz);
        const double phi = std::atan2(local.y, local.x);
        const int k = std::min(int((phi < 0 ? phi + 2 * M_PI : phi) / (2 * M_PI) * nphi), nphi - 1);
        if (j >= nz)
            outside += 1;
        else
            observed[size_t(j * nphi + k)] += 1;
    }
    // Rounding may carry a direction over the outline of the light or a border of a table's cell, seldom.
    INFO(different << " of " << compared << " densities differ");
    CHECK(different <= compared / 250);
    CHECK(outside <= 5);
    // Cells that expect few samples are pooled, and so are the samples that carried no light.
    double chi2 = 0, pooled_expected = 0, pooled_observed = outside, total = 0;
    int degrees = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
        const double e = expected[i] * samples;
        total += expected[i];
        if (e < 20) {
            pooled_expected += e;
            pooled_observed += observed[i];
        } else {
            chi2 += (observed[i] - e) * (observed[i] - e) / e;
            ++degrees;
        }
    }
    const double expected_missed = (1 - total) * samples;
    if (expected_missed > 20) {
        chi2 += (missed - expected_missed) * (missed - expected_missed) / expected_missed;
        ++degrees;
    } else {
        CHECK(std::fabs(missed - expected_missed) < 60);
    }
    if (pooled_expected > 20) {
        chi2 += (pooled_observed - pooled_expected) * (pooled_observed - pooled_expected) / pooled_expected;
        ++degrees;
    } else {
        CHECK(std::fabs(pooled_observed - pooled_expected) < 25);
    }
    INFO("chi2 " << chi2 << " of " << degrees << " cells, missed " << missed << " (" << expected_missed << ")");
    REQUIRE(degrees > 3);
    CHECK(chi2 < chi_square_bound(degrees - 1, 4));
}

}  // namespace

TEST_CASE("Rectangles and meshes: sampled directions follow the density", "[emitter]") {
    const Vec3f o = {-1, -0.7f, 2}, ex = {0, 1.5f, 0.2f}, ey = {1.8f, 0.1f, 0};
    for (uint32_t n : {1u, 10u}) {
        Scene scene;
        add_area(scene, add_rectangle(scene, o, ex, ey, n), splat(3));
        complete(scene);
        check_density(scene, {0, 0, 0}, {0, 0.05f, 2}, 0.2, 1);
        check_density(scene, {0, 0.1f, 1.8f}, {0, 0, 1}, 1.0, 2);
        check_density(scene, {40, 0, -80}, {-40.1f, 0, 82}, 0.0002, 3, 30000);
    }
    // An open box, seen from inside: some faces turn their back.
    Scene box;
    const std::vector<Vec3f> v = {{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {0, 2, 0},
                                  {0, 0, 3}, {1, 0, 3}, {1, 2, 3}, {0, 2, 3}};
    add_area(box,
             add_mesh(box, v, {{0, 1, 2}, {0, 2, 3}, {0, 4, 5}, {0, 5, 1}, {1, 2, 6}, {1, 6, 5}, {0, 3, 7}, {0, 7, 4}}),
             splat(1));
    complete(box);
    check_density(box, {0.3f, 0.9f, 1.0f}, {0, 0, 1}, 2.0, 4);
}

TEST_CASE("Spheres near, far and from inside: sampled directions follow the density", "[emitter]") {
    const Vec3f center = {0.4f, -0.3f, 0.8f}, axis = normalize(Vec3f{1, 2, -0.5f});
    for (double ratio : {1e-3, 0.1, 0.7, 0.99}) {
        Scene scene;
        add_area(scene, add_sphere(scene, center, 0.25f), splat(2));
        complete(scene);
        INFO("radius over distance " << ratio);
        const double sin2 = ratio * ratio;
        check_density(scene, center - axis * float(0.25 / ratio), axis, 1.02 * sin2 / (1 + std::sqrt(1 - sin2)), 11);
    }
    Scene inwards;
    add_area(inwards, add_sphere(inwards, center, 0.25f, true), splat(2));
    complete(inwards);
    check_density(inwards, center, axis, 2.0, 12);
    check_density(inwards, center + axis * 0.2f, axis, 2.0, 13);
}

TEST_CASE("Disks and cylinders: sampled directions follow the density", "[emitter]") {
    const Vec3f axis = normalize(Vec3f{1, -0.5f, 0.7f});
    Scene disk;
    add_area(disk, add_quadric(disk, PrimitiveType::disk, 0.8f, 0.8f, axis, {1, 2, 3}), splat(1));
    complete(disk);
    check_density(disk, Vec3f{1, 2, 3} + axis * 0.3f, -axis, 1.0, 21);
    check_density(disk, Vec3f{1.5f, 2, 3} + axis * 2.0f, -axis, 0.5, 22);
    Scene lamp;
    add_area(lamp, add_quadric(lamp, PrimitiveType::cylinder, 0.3f, 2.0f, axis, {0, 0, 0}), splat(1));
    complete(lamp);
    check_density(lamp, axis + frame_from_normal(axis).s * 0.6f, -frame_from_normal(axis).s, 1.0, 23);
    Scene tube;
    add_area(tube, add_quadric(tube, PrimitiveType::cylinder, 0.3f, 2.0f, axis, {0, 0, 0}, true), splat(1));
    complete(tube);
    check_density(tube, axis * 0.7f + frame_from_normal(axis).t * 0.1f, axis, 2.0, 24);
}

TEST_CASE("Environments: sampled directions follow the density, which integrates to one", "[emitter]") {
    Scene sky;
    add_emitter(sky, EmitterType::constant, splat(1));
    complete(sky);
    check_density(sky, {1, 2, 3}, {0, 0, 1}, 2.0, 31);

    const int w = 8, h = 6;
    std::vector<Rgb> image;
    for (int j = 0; j < h; ++j)
        for (int i = 0; i < w; ++i)
            image.push_back(splat(0.1f + 0.3f * float((i * 7 + j * 3) % 5) + (i == 5 && j == 3 ? 6.0f : 0.0f)));
    Scene scene;
    add_envmap(scene, w, h, image, splat(2), rotation_to({0.3f, -0.8f, 0.5f}));
    complete(scene);
    check_density(scene, {0, 0, 0}, {0.2f, 0.4f, -1}, 2.0, 32, 200000);

    // In the map's own coordinates, where the density is smooth within cells: 2 pi² sin(theta) du dv.
    const SceneView view = view_of(scene);
    double integral = 0;
    const int n = 60;
    for (int j = 0; j < h * n; ++j)
        for (int i = 0; i < w * n; ++i) {
            float sin_theta;
            const Vec3f local =
                envmap_direction({(float(i) + 0.5f) / float(w * n), (float(j) + 0.5f) / float(h * n)}, sin_theta);
            integral +=
                double(pdf_environment_direct<kAll>(view, scene.emitters[0].to_world.vector(local))) * sin_theta;
        }
    integral *= 2 * M_PI * M_PI / (double(w) * h * n * n);
    CHECK(integral == Approx(1).epsilon(1e-4));
}

TEST_CASE("Directions and image coordinates of an environment map invert each other, poles included", "[emitter]") {
    for (uint32_t i = 0; i < 2000; ++i) {
        const Vec4f r = random(71, i);
        // Up to 1e-6 from a pole.
        const float v = i % 2 ? r.y : 1e-6f + 1e-3f * r.y * r.y;
        float sin_theta;
        const Vec2f uv = envmap_uv(envmap_direction({r.x, v}, sin_theta));
        REQUIRE(std::fabs(uv.y - v) <= 1e-6f * std::max(v, 0.2f));
        const float du = std::fabs(uv.x - r.x);
        REQUIRE(std::min(du, 1.0f - du) < 1e-5f);
    }
}

TEST_CASE("Densities include the pick probability, uniform or not", "[emitter]") {
    Scene scene;
    add_area(scene, add_rectangle(scene, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 2), splat(1));
    const uint32_t ball = add_sphere(scene, {0, 4, 3}, 1);
    add_area(scene, ball, splat(4));
    add_emitter(scene, EmitterType::point, splat(6)).position = {0, 3, 4};
    add_emitter(scene, EmitterType::constant, splat(0.25f));
    for (const std::vector<double>& weights :
         {std::vector<double>{}, std::vector<double>{1, 5, 3, 11}, std::vector<double>{0, 1, 0, 3}}) {
        Scene s = scene;
        complete(s, weights);
        const SceneView view = view_of(s);
        const Vec3f p = {0.1f, 0.2f, 0.3f};
        double counts[4] = {};
        const uint32_t n = 20000;
        for (uint32_t i = 0; i < n; ++i) {
            EmitterSample e;
            if (!sample_emitter_direct<kAll>(view, p, random(81, i), e)) continue;
            counts[e.emitter] += 1;
            const EmitterType type = s.emitters[e.emitter].type;
            REQUIRE(e.delta == (type == EmitterType::point));
            REQUIRE((e.distance == kInfinity) == (type == EmitterType::constant));
            if (type == EmitterType::point)
                REQUIRE(e.pdf_sa == s.emitters[e.emitter].pick_probability);
            else if (type == EmitterType::constant)
                REQUIRE(e.pdf_sa == Approx(pdf_environment_direct<kAll>(view, e.wi)));
            else {
                // The other shape may be nearer; ask for the shape that was sampled.
                SurfacePoint hit{};
                hit.p = e.p;
                hit.ng = e.ng;
                hit.prim = s.shapes[s.emitters[e.emitter].shape].first_primitive;
                REQUIRE(pdf_emitter_direct<kAll>(view, e.emitter, p, e.wi, hit) == Approx(e.pdf_sa).epsilon(1e-4));
            }
        }
        for (uint32_t k = 0; k < 4; ++k) {
            const double q = s.emitters[k].pick_probability;
            INFO("emitter " << k);
            CHECK(std::fabs(counts[k] - q * n) <= 4.5 * std::sqrt(n * q * (1 - q)));
        }
    }
}

TEST_CASE("Specialised code gives the samples of the general one", "[emitter]") {
    constexpr Features kSmall = {0, bit(EmitterType::area) | bit(EmitterType::point), bit(PrimitiveType::triangle)};
    Scene scene;
    add_area(scene, add_rectangle(scene, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 2), splat(1));
    add_emitter(scene, EmitterType::point, splat(6)).position = {0, 3, 4};
    complete(scene);
    const SceneView view = view_of(scene);
    for (uint32_t i = 0; i < 2000; ++i) {
        EmitterSample a, b;
        const bool lit = sample_emitter_direct<kAll>(view, {0, 0, 0}, random(91, i), a);
        REQUIRE(lit == sample_emitter_direct<kSmall>(view, {0, 0, 0}, random(91, i), b));
        if (!lit) continue;
        REQUIRE(a.p == b.p);
        REQUIRE(a.pdf_sa == b.pdf_sa);
        REQUIRE(a.emitter == b.emitter);
    }
}
