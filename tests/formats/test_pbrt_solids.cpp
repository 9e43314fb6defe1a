// libs: ambilux_formats
// timeout: 60
// Textures of pbrt that have values at places of the world, on shapes of all kinds.
#include <cmath>

#include "core/sampling.h"
#include "formats/pbrt/noise.h"
#include "scene/surface.h"
#include "tests/support/mitsuba_text.h"
#include "tests/support/pbrt_text.h"
#include "transport/texture.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features F = kAllFeatures;

const BsdfRecord& bsdf(const Scene& s, size_t shape = 0) {
    return s.bsdfs[s.materials[s.shapes[shape].material].front];
}

/// Largest and mean distance between a diffuse reflectance and what `expected` has there, over points of all
/// primitives.
struct Difference {
    double most = 0, mean = 0;
};
template <class Expected>
Difference difference(const Scene& s, Expected&& expected) {
    const SceneView view = s.view();
    Difference d;
    int count = 0;
    uint64_t random = 1;
    const auto uniform = [&] {
        random = random * 6364136223846793005u + 1442695040888963407u;
        return float(random >> 40) * 0x1p-24f;
    };
    for (int i = 0; i < 3000; ++i) {
        const uint32_t prim = uint32_t(uniform() * float(s.triangles.size() + s.quadrics.size()));
        Vec2f c = square_to_triangle({uniform(), uniform()});
        if (!view.is_triangle(prim)) {
            const PrimitiveType type = view.quadric(prim).type;
            const Vec2f u = {uniform(), uniform()};
            c = type == PrimitiveType::sphere ? octahedral_encode(square_to_sphere(u))
                : type == PrimitiveType::disk ? square_to_disk(u)
                                              : Vec2f{kPi * (2 * u.x - 1), u.y};
        }
        const SurfacePoint point = surface_at<F>(view, prim, c.x, c.y);
        const Rgb got = eval_rgb<F>(view, bsdf(s, point.shape).as<Diffuse>().reflectance, point.uv);
        const double off = double(max_component(abs(got - expected(point))));
        d.most = std::max(d.most, off), d.mean += off, ++count;
    }
    d.mean /= count;
    return d;
}

const std::string kMixed =
    "Texture \"f\" \"float\" \"fbm\" \"integer octaves\" 3 "
    "Texture \"m\" \"spectrum\" \"mix\" \"rgb tex1\" [.5 .4 .3] \"rgb tex2\" [.7 .2 .5] \"texture amount\" \"f\" "
    "Material \"diffuse\" \"texture reflectance\" \"m\" ";

Rgb mixed(Vec3f p) {
    const float t = float(pbrt::fbm({p.x, p.y, p.z}, 0.5, 3));
    return Rgb{0.5f, 0.4f, 0.3f} * (1 - t) + Rgb{0.7f, 0.2f, 0.5f} * t;
}

const std::string kTriangles =
    "Shape \"trianglemesh\" \"point3 P\" [0 0 0  3 0 1  0 2 0  3 2 2] \"integer indices\" [0 1 2 1 3 2] ";

}  // namespace

TEST_CASE("noise is Perlin's") {
    // The number beside his program of 2002.
    CHECK(pbrt::noise(3.14, 42, 7) == Approx(0.13691995878400012).margin(1e-14));
    CHECK(pbrt::noise(-4.0, 3.0, 17.0) == 0);
    CHECK(std::fabs(pbrt::noise(1e12, 0, 0)) <= 1);
    CHECK(pbrt::fbm({0.3, 0.4, 0.5}, 0.5, 1) == pbrt::noise(0.3, 0.4, 0.5));
    CHECK(pbrt::turbulence({0.3, 0.4, 0.5}, 0.5, 1) == Approx(std::fabs(pbrt::noise(0.3, 0.4, 0.5)) + 0.1));
}

TEST_CASE("a solid texture has its value at every point of a mesh") {
    const Scene s = load_pbrt_world("Translate 1 2 3 " + kMixed + "Translate 0 0 -2 " + kTriangles);
    // In the coordinates of the texture, which stands 2 above the mesh.
    const Difference d = difference(s, [](const SurfacePoint& point) { return mixed(point.p - Vec3f{1, 2, 3}); });
    CHECK(d.most < 0.004);
    CHECK(d.mean < 0.001);
    CHECK(has_note(s, "solid textures are images of their shape, of texels about 3e-02 across"));
}

TEST_CASE("a solid texture has its value at every point of a sphere, a disk and a cylinder") {
    for (const char* shape : {"sphere", "disk", "cylinder"}) {
        INFO(shape);
        const Scene s = load_pbrt_world(kMixed + "Translate .3 0 1 Rotate 30 1 1 0 Shape \"" + shape + "\"");
        REQUIRE(s.quadrics.size() == 1);
        const Difference d = difference(s, [](const SurfacePoint& point) { return mixed(point.p); });
        CHECK(d.most < 0.008);
        CHECK(d.mean < 0.001);
    }
}

TEST_CASE("marble, windy and wrinkled follow pbrt's formulas") {
    const auto reflectance = [](const std::string& type, const std::string& parameters) {
        return load_pbrt_world("Texture \"f\" \"float\" \"" + type + "\" " + parameters +
                               " Texture \"m\" \"spectrum\" \"mix\" \"rgb tex1\" [0 0 0] \"rgb tex2\" [.5 .5 .5] "
                               "\"texture amount\" \"f\" Material \"diffuse\" \"texture reflectance\" \"m\" " +
                               kTriangles);
    };
    const Difference wrinkled = difference(
        reflectance("wrinkled", "\"integer octaves\" 2 \"float roughness\" .3"),
        [](const SurfacePoint& s) { return splat(0.5f * float(pbrt::turbulence({s.p.x, s.p.y, s.p.z}, 0.3, 2))); });
    CHECK(wrinkled.mean < 0.002);
    const Difference windy = difference(reflectance("windy", ""), [](const SurfacePoint& s) {
        const Vec3d p = {s.p.x, s.p.y, s.p.z}, far = {0.1 * p.x, 0.1 * p.y, 0.1 * p.z};
        return splat(std::clamp(0.5f * float(std::fabs(pbrt::fbm(far, 0.5, 3)) * pbrt::fbm(p, 0.5, 6)), 0.0f, 1.0f));
    });
    CHECK(windy.mean < 0.0005);
    const Scene marble = load_pbrt_world(
        "Texture \"m\" \"spectrum\" \"marble\" \"integer octaves\" 1 \"float scale\" 2 \"float variation\" 0 "
        "Material \"diffuse\" \"texture reflectance\" \"m\" " +
        kTriangles);
    // Without variation: layers along y. At their darkest the curve of the last four colours.
    const SceneView view = marble.view();
    const SurfacePoint point = surface_at<F>(view, 0, 0.3f, 0.39f);
    const float t = 6 * (0.5f + 0.5f * std::sin(2 * point.p.y)), x = t - 5, y = 1 - x;
    REQUIRE((t > 5 && t < 6));
    CHECK(eval_rgb<F>(view, bsdf(marble).as<Diffuse>().reflectance, point.uv).x ==
          Approx(1.5f * (0.58f * (y * y * y + 3 * y * y * x + x * x * x) + 0.2f * 3 * y * x * x)).margin(0.005));
}

TEST_CASE("checkerboards of three dimensions and mixes by direction") {
    const Scene s = load_pbrt_world(
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"integer dimension\" 3 \"rgb tex1\" [.8 .8 .8] \"rgb tex2\" "
        "[.2 .2 .2] Material \"diffuse\" \"texture reflectance\" \"c\" Translate 0.5 0.5 0.5 " +
        kTriangles);
    const Difference checks = difference(s, [](const SurfacePoint& point) {
        const float sum = std::floor(point.p.x) + std::floor(point.p.y) + std::floor(point.p.z);
        return splat(std::fmod(sum, 2.0f) == 0 ? 0.8f : 0.2f);
    });
    CHECK(checks.mean < 0.02);  // blurred over a texel of 1/32 at the edges
    const Scene d = load_pbrt_world(
        "Rotate 90 1 0 0 Texture \"d\" \"spectrum\" \"directionmix\" \"rgb tex1\" [.9 0 0] \"rgb tex2\" [0 .5 0] "
        "Rotate -90 1 0 0 Material \"diffuse\" \"texture reflectance\" \"d\" Shape \"sphere\"");
    // (0,1,0) turned to (0,0,1)
    const Difference turned = difference(d, [](const SurfacePoint& point) {
        const float c = std::fabs(point.ng.z);
        return Rgb{0.9f, 0, 0} * c + Rgb{0, 0.5f, 0} * (1 - c);
    });
    CHECK(turned.most < 0.02);
}

TEST_CASE("images beside solid textures keep their place on a mesh") {
    // A checkerboard of the plane as one side of a mix that a solid texture of weight 0 or 1 chooses.
    const Scene s = load_pbrt_world(
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"float vscale\" 4 \"rgb tex1\" [.8 0 0] "
        "\"rgb tex2\" [0 .8 0] "
        "Texture \"s\" \"float\" \"checkerboard\" \"integer dimension\" 3 \"float tex1\" 0 \"float tex2\" 1 "
        "Texture \"m\" \"spectrum\" \"mix\" \"texture tex1\" \"c\" \"rgb tex2\" [0 0 .8] \"texture amount\" \"s\" "
        "Material \"diffuse\" \"texture reflectance\" \"m\" "
        "Shape \"trianglemesh\" \"point3 P\" [0 0 .5  2 0 .5  0 2 .5  2 2 .5] \"point2 uv\" [0 0 1 0 0 1 1 1] "
        "\"integer indices\" [0 1 2 1 3 2]");
    const Difference d = difference(s, [](const SurfacePoint& point) {
        if (std::fmod(std::floor(point.p.x) + std::floor(point.p.y), 2.0f) != 0) return Rgb{0, 0, 0.8f};
        const float sum = std::floor(2 * point.p.x) + std::floor(2 * point.p.y);
        return std::fmod(sum, 2.0f) == 0 ? Rgb{0.8f, 0, 0} : Rgb{0, 0.8f, 0};
    });
    CHECK(d.mean < 0.03);
    // On a sphere the image stays as it is.
    const Scene both = load_pbrt_world(
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [.8 0 0] \"rgb tex2\" [0 .8 0] "
        "Texture \"r\" \"float\" \"wrinkled\" \"integer octaves\" 2 "
        "Material \"diffuse\" \"texture reflectance\" \"c\" \"texture displacement\" \"r\" Shape \"sphere\"");
    CHECK(both.textures.size() == 2);
    CHECK(both.textures[size_t(bsdf(both).bump_map)].type == TextureType::bitmap);
    CHECK(both.textures[size_t(bsdf(both).as<Diffuse>().reflectance.texture)].type == TextureType::checkerboard);
}

TEST_CASE("solid textures keep their budget of texels and say what they cannot do") {
    const std::string fine =
        "Texture \"m\" \"spectrum\" \"marble\" \"float scale\" 1000 Material \"diffuse\" \"texture reflectance\" "
        "\"m\" ";
    const Scene s = load_pbrt_world(fine +
                                    "Shape \"sphere\" Shape \"bilinearmesh\" \"point3 P\" "
                                    "[0 0 0 1 0 0 0 1 0 1 1 3] ");
    for (const Texture& texture : s.textures) CHECK(double(texture.width) * texture.height <= 1.1 * (1 << 21));
    LoadOptions little;
    little.limits.total_bytes = 1 << 20;
    CHECK_THAT(pbrt_error("WorldBegin " + fine + "Shape \"sphere\"", little), ContainsSubstring("total_bytes"));
    const auto error = [](const std::string& world) { return pbrt_error("WorldBegin " + world); };
    CHECK_THAT(error(fine + "ObjectBegin \"o\" Shape \"sphere\" ObjectEnd"), ContainsSubstring("inside of an object"));
    CHECK_THAT(error(fine + "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]"), ContainsSubstring("on curves"));
    CHECK_THAT(error("Scale 0 1 1 Texture \"f\" \"float\" \"fbm\""), ContainsSubstring("singular"));
    CHECK_THAT(error("Texture \"f\" \"spectrum\" \"fbm\""), ContainsSubstring("texture type 'fbm' is not supported"));
    CHECK_THAT(error("Texture \"f\" \"float\" \"marble\""),
               ContainsSubstring("texture type 'marble' is not supported"));
    CHECK_THAT(error("Texture \"f\" \"float\" \"fbm\" Material \"conductor\" \"float uroughness\" .2 \"float "
                     "vroughness\" .4 \"texture displacement\" \"f\" " +
                     kTriangles),
               ContainsSubstring("two roughnesses"));
}
