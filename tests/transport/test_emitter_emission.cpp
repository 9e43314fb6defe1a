// libs: ambilux_scene ambilux_core
// timeout: 120
// Light leaving emitters: its power, and the irradiance it brings, against light sampling from the receiver's side.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/emitter/emission.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features kAll = kAllFeatures;
constexpr int kKinds = 10;
const char* const kNames[kKinds] = {"mesh", "sphere",      "disk",     "cylinder", "point",
                                    "spot", "directional", "constant", "envmap",   "hidden area"};

std::vector<Rgb> sky_image() {
    std::vector<Rgb> image;
    for (int j = 0; j < 7; ++j)
        for (int i = 0; i < 10; ++i)
            image.push_back(splat(0.2f + 0.2f * float((i * 7 + j * 3) % 5) + (i == 5 && j == 2 ? 10.0f : 0.0f)));
    return image;
}

Scene make_light(int kind) {
    Scene s;
    switch (kind) {
        case 0: add_area(s, add_rectangle(s, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 5), splat(3)); break;
        case 1: add_area(s, add_sphere(s, {0.5f, 1, 3}, 0.7f), splat(4)); break;
        case 2:
            add_area(s, add_quadric(s, PrimitiveType::disk, 0.8f, 0.8f, {-0.5f, 0, -1}, {1, 0, 2}), splat(6));
            break;
        case 3:
            add_area(s, add_quadric(s, PrimitiveType::cylinder, 0.4f, 2.0f, {0, 1, 0.3f}, {0, -1, 2}), splat(2));
            break;
        case 4: add_emitter(s, EmitterType::point, splat(30)).position = {0.3f, 0.4f, 2}; break;
        case 5: add_spot(s, {1, 0, 3}, {-1, 0, -3}, 30, 10, splat(40)); break;
        case 6: add_emitter(s, EmitterType::directional, splat(0.5f)).direction = normalize(Vec3f{0.3f, 0, -1}); break;
        case 7: add_emitter(s, EmitterType::constant, splat(0.25f)); break;
        case 9:
            add_area(s, add_rectangle(s, {-1, -1, 2}, {0, 2, 0}, {2, 0, 0}, 5), splat(3)).type =
                EmitterType::hidden_area;
            break;
        default: add_envmap(s, 10, 7, sky_image(), splat(0.5f), rotation_to({0.2f, 1, 0.3f})); break;
    }
    complete(s);
    s.bounds_center = {0, 0, 1};
    s.bounds_radius = 3;
    return s;
}

double flux(const EmissionSample& s) {
    return double(s.radiance.x) * s.cos_theta / (double(s.pick) * s.pdf_pos * s.pdf_dir);
}

struct Unclassified {
    static constexpr const char* plugin = "new";
    static constexpr bool surface = true, delta_position = false, delta_direction = false, infinite = false;
};
struct Classified : Unclassified {
    static constexpr LightStart start = LightStart::surface;
};
struct Misclassified : Unclassified {
    static constexpr LightStart start = LightStart::environment;
};

}  // namespace

TEST_CASE("An emitter that does not say where its light starts, or says otherwise than its traits, is none") {
    STATIC_REQUIRE((EmitterModel<Classified> && EmitterModel<AreaEmitter>));
    STATIC_REQUIRE_FALSE(EmitterModel<Unclassified>);
    STATIC_REQUIRE_FALSE(EmitterModel<Misclassified>);
    for (uint32_t type = 0; type < EmitterModels::count; ++type)
        EmitterModels::for_each([&](auto m) {
            using Model = typename decltype(m)::type;
            if (type == EmitterModels::index<Model>())
                CHECK(light_start<kAllFeatures>(EmitterType(type)) == Model::start);
        });
}

TEST_CASE("Emission carries the emitter's power", "[emitter]") {
    const double disk = M_PI * 9;
    // Spot: 2 pi ∫ I(angle) sin(angle), full to 10 degrees, from there a ramp to zero at 30.
    double spot = 0, sky = 0;
    const int n = 100000;
    for (int i = 0; i < n; ++i) {
        const double a = (i + 0.5) / n * 30, rad = M_PI / 180;
        spot += 2 * M_PI * 40 * std::min(1.0, (30 - a) / 20) * std::sin(a * rad) * 30 * rad / n;
    }
    // The interpolant's mean over a row is linear in v between rows.
    const auto image = sky_image();
    for (int j = 0; j < n; ++j) {
        const double y = (j + 0.5) / n * 6;
        const int row = int(y);
        double a = 0, b = 0;
        for (int i = 0; i < 10; ++i) {
            a += image[size_t(row * 10 + i)].x / 10.0;
            b += image[size_t((row + 1) * 10 + i)].x / 10.0;
        }
        sky += 0.5 * (a + (b - a) * (y - row)) * std::sin(M_PI * y / 6) * 2 * M_PI * M_PI / n;
    }
    const double expected[kKinds] = {M_PI * 3 * 4,
                                     M_PI * 4 * 4 * M_PI * 0.49,
                                     M_PI * 6 * M_PI * 0.64,
                                     M_PI * 2 * 2 * M_PI * 0.4 * 2,
                                     4 * M_PI * 30,
                                     spot,
                                     0.5 * disk,
                                     0.25 * 4 * M_PI * disk,
                                     sky * disk,
                                     M_PI * 3 * 4};
    for (int kind = 0; kind < kKinds; ++kind) {
        const Scene scene = make_light(kind);
        const SceneView view = view_of(scene);
        Statistics stats;
        int wrong = 0;
        const auto close = [](float a, float b) { return std::fabs(a - b) <= 1e-4f * b + 2e-7f; };
        for (uint32_t i = 0; i < 400000; ++i) {
            const Vec4f a = random(1, i), b = random(1, i, 1);
            EmissionSample s;
            if (!sample_emission<kAll>(view, a, {b.x, b.y}, s)) {
                stats.add(0);
                continue;
            }
            stats.add(flux(s));
            const bool hidden = scene.emitters[0].type == EmitterType::hidden_area;
            const Vec3f ng = hidden ? Vec3f{0, 0, -1} : s.ng;
            wrong += std::fabs(length(s.d) - 1) > 1e-5f || std::fabs(dot(s.d, ng) - s.cos_theta) > 1e-5f;
            // The queried densities are the sampled ones. Where a rounded direction matters, at the border of a table's
            // cell, the rim of a spot or the pole of a map, they lie between those around it.
            wrong += !close(pdf_emission_position<kAll>(view, 0, s.prim), s.pdf_pos);
            const float queried = pdf_emission_direction<kAll>(view, 0, ng, s.d);
            if (close(queried, s.pdf_dir)) continue;
            float low = queried, high = queried;
            const Frame around = frame_from_normal(s.d);
            for (int k = 0; k < 8; ++k) {
                const float angle = float(k) * kPi / 4;
                const Vec3f moved = normalize(s.d + (around.s * cosf(angle) + around.t * sinf(angle)) * 1e-6f);
                const float p = pdf_emission_direction<kAll>(view, 0, ng, moved);
                low = std::min(low, p), high = std::max(high, p);
            }
            wrong += !(s.pdf_dir >= low * 0.9999f && s.pdf_dir <= high * 1.0001f);
        }
        INFO(kNames[kind] << ": " << stats.mean() << " +- " << stats.standard_error() << ", expected "
                          << expected[kind]);
        CHECK(wrong == 0);
        CHECK(std::fabs(stats.mean() - expected[kind]) < 4.5 * stats.standard_error() + 1e-5 * expected[kind]);
        CHECK(4.5 * stats.standard_error() < 0.01 * expected[kind]);
    }
}

TEST_CASE("B7: the kinds of delta are told apart", "[emitter]") {
    for (int kind = 0; kind < kKinds; ++kind) {
        const Scene scene = make_light(kind);
        const EmitterType type = scene.emitters[0].type;
        EmissionSample s;
        INFO(kNames[kind]);
        REQUIRE(sample_emission<kAll>(view_of(scene), {0.5f, 0.3f, 0.6f, 0.2f}, {0.4f, 0.45f}, s));
        CHECK(s.delta_position ==
              (type == EmitterType::point || type == EmitterType::spot || type == EmitterType::hidden_area));
        CHECK(s.delta_direction == (type == EmitterType::directional));
        CHECK(s.infinite ==
              (type == EmitterType::directional || type == EmitterType::constant || type == EmitterType::envmap));
        if (s.delta_position) CHECK(s.pdf_pos == 1.0f);
        if (s.delta_direction) CHECK(s.pdf_dir == 1.0f);
        if (s.infinite) CHECK(length(s.p - scene.bounds_center) >= scene.bounds_radius);
    }
}

TEST_CASE("Both directions of transport agree: irradiance by emission and by light sampling", "[emitter]") {
    // Receiver: a square of side 1.4 in the plane z = 0, facing up.
    for (int kind = 0; kind < kKinds; ++kind) {
        const Scene scene = make_light(kind);
        const SceneView view = view_of(scene);
        Statistics emitted, gathered;
        for (uint32_t i = 0; i < 5000000; ++i) {
            const Vec4f a = random(2, i), b = random(2, i, 1);
            EmissionSample s;
            double value = 0;
            if (sample_emission<kAll>(view, a, {b.x, b.y}, s) && s.d.z < 0) {
                const float t = -s.p.z / s.d.z;
                const Vec3f hit = s.p + s.d * t;
                if (t > 0 && std::fabs(hit.x) < 0.7f && std::fabs(hit.y) < 0.7f) value = flux(s) / 1.96;
            }
            emitted.add(value);
        }
        for (uint32_t i = 0; i < 1000000; ++i) {
            const Vec4f a = random(3, i), b = random(3, i, 1);
            EmitterSample s;
            const bool lit = sample_emitter_direct<kAll>(view, {1.4f * b.x - 0.7f, 1.4f * b.y - 0.7f, 0}, a, s);
            gathered.add(lit ? double(s.radiance.x) * std::max(0.0f, s.wi.z) / s.pdf_sa : 0.0);
        }
        const double error = std::sqrt(emitted.standard_error() * emitted.standard_error() +
                                       gathered.standard_error() * gathered.standard_error());
        INFO(kNames[kind] << ": " << emitted.mean() << " and " << gathered.mean() << " +- " << error);
        CHECK(std::fabs(emitted.mean() - gathered.mean()) < 4.5 * error + 1e-5 * gathered.mean());
        CHECK(4.5 * error < 0.02 * gathered.mean());
    }
}

TEST_CASE("B9: a larger bounding sphere changes no irradiance", "[emitter]") {
    for (int kind : {6, 7, 8}) {
        Scene scene = make_light(kind);
        Statistics stats[2];
        for (int k = 0; k < 2; ++k) {
            scene.bounds_radius = k == 0 ? 1.0f : 4.0f;
            const SceneView view = view_of(scene);
            for (uint32_t i = 0; i < 1000000; ++i) {
                const Vec4f a = random(4, i, uint32_t(2 * k)), b = random(4, i, uint32_t(2 * k + 1));
                EmissionSample s;
                double value = 0;
                if (sample_emission<kAll>(view, a, {b.x, b.y}, s)) {
                    // Flux through a small sphere inside of both bounds.
                    const Vec3f to_center = scene.bounds_center - s.p;
                    if (length_squared(to_center - s.d * dot(to_center, s.d)) < 0.25f) value = flux(s);
                }
                stats[k].add(value);
            }
        }
        const double error = std::sqrt(stats[0].standard_error() * stats[0].standard_error() +
                                       stats[1].standard_error() * stats[1].standard_error());
        INFO(kNames[kind] << ": " << stats[0].mean() << " and " << stats[1].mean());
        CHECK(std::fabs(stats[0].mean() - stats[1].mean()) < 4.5 * error);
        CHECK(4.5 * error < 0.05 * stats[0].mean());
    }
}
