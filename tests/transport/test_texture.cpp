// libs: ambilux_scene ambilux_core
// Texture lookup: texel positions, wrap modes, formats, gradients, and coordinates that no one should use.
#include "tests/support/catch.h"
#include "tests/support/emitter_scene.h"
#include "transport/texture.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

constexpr Features kAll = kAllFeatures;

float lookup(const Scene& s, Vec2f uv) { return eval_texture<kAll>(view_of(s), s.textures[0], uv).x; }

/// A texture whose texel (x,y) is f(x,y).
Scene texture_scene(uint32_t w, uint32_t h, const std::function<float(uint32_t, uint32_t)>& f) {
    Scene s;
    std::vector<Rgb> colors;
    for (uint32_t y = 0; y < h; ++y)
        for (uint32_t x = 0; x < w; ++x) colors.push_back(splat(f(x, y)));
    add_texture(s, w, h, colors);
    return s;
}

}  // namespace

TEST_CASE("Texel centres lie at (i+0.5)/n, row 0 at t = 0", "[texture]") {
    const Scene s = texture_scene(4, 3, [](uint32_t x, uint32_t y) { return float(x + 10 * y); });
    for (uint32_t y = 0; y < 3; ++y)
        for (uint32_t x = 0; x < 4; ++x)
            CHECK(lookup(s, {(float(x) + 0.5f) / 4, (float(y) + 0.5f) / 3}) == Approx(float(x + 10 * y)).margin(2e-5));
    // Between centres: linear.
    CHECK(lookup(s, {(1 + 0.75f) / 4, (0 + 0.9f) / 3}) == Approx(1.25 + 4).epsilon(1e-5));
}

TEST_CASE("Wrap modes at and beyond the corners", "[texture]") {
    Scene s = texture_scene(2, 2, [](uint32_t x, uint32_t y) { return float(1 + x + 2 * y); });  // 1 2 / 3 4
    s.textures[0].wrap = WrapMode::repeat;
    for (Vec2f corner : {Vec2f{0, 0}, Vec2f{1, 0}, Vec2f{0, 1}, Vec2f{1, 1}, Vec2f{-3, 5}})
        CHECK(lookup(s, corner) == Approx(2.5));
    CHECK(lookup(s, {0.25f + 7, 0.25f - 4}) == Approx(1));
    CHECK(lookup(s, {-0.25f, 0.25f}) == Approx(2));
    s.textures[0].wrap = WrapMode::clamp;
    CHECK(lookup(s, {0, 0}) == Approx(1));
    CHECK(lookup(s, {1, 0}) == Approx(2));
    CHECK(lookup(s, {0, 1}) == Approx(3));
    CHECK(lookup(s, {1, 1}) == Approx(4));
    CHECK(lookup(s, {-9, 100}) == Approx(3));
    s.textures[0].wrap = WrapMode::mirror;
    CHECK(lookup(s, {0, 0}) == Approx(1));
    CHECK(lookup(s, {1, 1}) == Approx(4));
    CHECK(lookup(s, {-0.25f, 0.25f}) == Approx(1));
    CHECK(lookup(s, {1.25f, 0.25f}) == Approx(2));
    CHECK(lookup(s, {1.75f, 0.25f}) == Approx(1));
    CHECK(lookup(s, {2.25f, -0.75f}) == Approx(3));
    // Continuous across every border, in each mode.
    for (WrapMode wrap : {WrapMode::repeat, WrapMode::mirror, WrapMode::clamp}) {
        s.textures[0].wrap = wrap;
        for (float border : {-1.0f, 0.0f, 0.5f, 1.0f, 2.0f})
            CHECK(lookup(s, {border - 1e-5f, 0.3f}) == Approx(lookup(s, {border + 1e-5f, 0.3f})).margin(2e-4));
    }
}

TEST_CASE("Nearest-texel lookup changes at texel borders", "[texture]") {
    Scene s = texture_scene(4, 1, [](uint32_t x, uint32_t) { return float(x); });
    s.textures[0].filter = TextureFilter::nearest;
    CHECK(lookup(s, {0.249f, 0.5f}) == 0);
    CHECK(lookup(s, {0.251f, 0.5f}) == 1);
    CHECK(lookup(s, {0.999f, 0.5f}) == 3);
    CHECK(lookup(s, {1.001f, 0.5f}) == 0);
    CHECK(lookup(s, {-0.001f, 0.5f}) == 3);
    s.textures[0].wrap = WrapMode::clamp;
    CHECK(lookup(s, {1.0f, 1.0f}) == 3);
    CHECK(lookup(s, {5.0f, 1.0f}) == 3);
    s.textures[0].wrap = WrapMode::mirror;
    CHECK(lookup(s, {1.1f, 0.5f}) == 3);
    CHECK(lookup(s, {2.0f, 0.5f}) == 0);
}

TEST_CASE("A texture of one texel is constant in every mode", "[texture]") {
    Scene s = texture_scene(1, 1, [](uint32_t, uint32_t) { return 0.7f; });
    for (WrapMode wrap : {WrapMode::repeat, WrapMode::mirror, WrapMode::clamp})
        for (TextureFilter filter : {TextureFilter::nearest, TextureFilter::bilinear}) {
            s.textures[0].wrap = wrap;
            s.textures[0].filter = filter;
            for (Vec2f uv : {Vec2f{0, 0}, Vec2f{0.5f, 0.5f}, Vec2f{1, 1}, Vec2f{-7.3f, 12.9f}})
                CHECK(lookup(s, uv) == Approx(0.7f));
        }
}

TEST_CASE("8-bit texels are decoded channel by channel before they are interpolated", "[texture]") {
    Scene s;
    s.tables.resize(5, -1.0f);  // a table need not come first
    Texture t = blank_texture(2, 1, TexelFormat::rgba8);
    t.decode_table = uint32_t(s.tables.size());
    for (int i = 0; i < 256; ++i) {  // IEC 61966-2-1
        const double c = i / 255.0;
        s.tables.push_back(float(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4)));
    }
    s.texels.resize(16, 0);
    t.offset = 16;
    s.texels.insert(s.texels.end(), {255, 128, 0, 9, 0, 64, 255, 200});
    s.textures.push_back(t);
    const Rgb left = eval_texture<kAll>(view_of(s), t, {0.25f, 0.5f}),
              middle = eval_texture<kAll>(view_of(s), t, {0.5f, 0.5f});
    CHECK(left.x == Approx(1));
    CHECK(left.y == Approx(0.2158605));
    CHECK(left.z == Approx(0).margin(1e-7));
    CHECK(middle.x == Approx(0.5));
    CHECK(middle.y == Approx((0.2158605 + 0.0512695) / 2).epsilon(1e-5));
    CHECK(middle.z == Approx(0.5));
}

TEST_CASE("Checkerboard: half of the unit square per cell", "[texture]") {
    Scene s;
    Texture t = blank_texture(0, 0, TexelFormat::rgba8);
    t.type = TextureType::checkerboard;
    t.color0 = {1, 2, 3};
    t.color1 = {4, 5, 6};
    s.textures.push_back(t);
    CHECK(lookup(s, {0.2f, 0.3f}) == 1);
    CHECK(lookup(s, {0.7f, 0.3f}) == 4);
    CHECK(lookup(s, {0.2f, 0.8f}) == 4);
    CHECK(lookup(s, {0.7f, 0.8f}) == 1);
    CHECK(lookup(s, {-0.2f, 0.3f}) == 4);
    CHECK(lookup(s, {5.2f, -3.9f}) == 1);
    s.textures[0].to_uv[0][0] = 2;
    CHECK(lookup(s, {0.3f, 0.3f}) == 4);
}

TEST_CASE("Parameters: value times texture, scalars by luminance, no lookup where the scene has no textures",
          "[texture]") {
    Scene s;
    add_texture(s, 1, 1, {{0.5f, 0.25f, 1.0f}});
    const SceneView view = view_of(s);
    const ParamRgb rgb = {{2, 4, 1}, 0};
    const Rgb c = eval_rgb<kAll>(view, rgb, {0.1f, 0.2f});
    CHECK(c.x == Approx(1));
    CHECK(c.y == Approx(1));
    CHECK(c.z == Approx(1));
    CHECK(eval_float<kAll>(view, {3, 0}, {0.1f, 0.2f}) == Approx(3 * luminance({0.5f, 0.25f, 1.0f})));
    CHECK(eval_float<kAll>(view, {3, -1}, {0.1f, 0.2f}) == 3);
    constexpr Features kNoTextures = {1, 1, 1};
    CHECK(eval_rgb<kNoTextures>(view, rgb, {0.1f, 0.2f}) == rgb.value);
}

TEST_CASE("to_uv turns and moves the image", "[texture]") {
    Scene s = texture_scene(4, 2, [](uint32_t x, uint32_t y) { return float(x + 10 * y); });
    Texture& t = s.textures[0];
    // s = v, t = u + 0.5
    t.to_uv[0][0] = t.to_uv[1][1] = 0;
    t.to_uv[0][1] = t.to_uv[1][0] = 1;
    t.to_uv[1][2] = 0.5f;
    CHECK(lookup(s, {0.25f, 0.625f}) == Approx(12));
}

TEST_CASE("Height gradients equal finite differences", "[texture]") {
    Scene s = texture_scene(5, 4, [](uint32_t x, uint32_t y) { return 0.1f * float((x * 7 + y * 5 + x * y) % 11); });
    Texture& t = s.textures[0];
    t.to_uv[0][0] = 1.3f;
    t.to_uv[0][1] = -0.6f;
    t.to_uv[0][2] = 0.2f;
    t.to_uv[1][0] = 0.9f;
    t.to_uv[1][1] = 2.1f;
    for (WrapMode wrap : {WrapMode::repeat, WrapMode::mirror, WrapMode::clamp}) {
        t.wrap = wrap;
        int compared = 0;
        for (uint32_t i = 0; i < 3000; ++i) {
            const Vec4f r = random(7, i);
            const Vec2f uv = {4 * r.x - 2, 4 * r.y - 2};
            const float h = 1.0f / 1024;
            // The interpolant bends at texel centres: keep both ends of a difference in one cell.
            const auto cell = [&](Vec2f p) {
                const Vec2f st = texture_coordinates(t, p);
                return std::pair{std::floor(st.x * 5 - 0.5f), std::floor(st.y * 4 - 0.5f)};
            };
            const auto edge = [&](Vec2f p) {
                const Vec2f st = texture_coordinates(t, p);
                return std::pair{std::floor(st.x), std::floor(st.y)};
            };
            const Vec2f u0 = {uv.x - h, uv.y}, u1 = {uv.x + h, uv.y}, v0 = {uv.x, uv.y - h}, v1 = {uv.x, uv.y + h};
            if (cell(u0) != cell(u1) || cell(v0) != cell(v1) || cell(u0) != cell(v0) || edge(u0) != edge(u1) ||
                edge(v0) != edge(v1))
                continue;
            ++compared;
            const Vec2f g = texture_height_gradient<kAll>(view_of(s), t, uv);
            const float fu = (lookup(s, u1) - lookup(s, u0)) / (2 * h), fv = (lookup(s, v1) - lookup(s, v0)) / (2 * h);
            // A bilinear function has no odd terms beyond the first: central differences are exact up to rounding.
            REQUIRE(g.x == Approx(fu).margin(2e-3));
            REQUIRE(g.y == Approx(fv).margin(2e-3));
        }
        CHECK(compared > 2000);
    }
    t.filter = TextureFilter::nearest;
    CHECK(texture_height_gradient<kAll>(view_of(s), t, {0.3f, 0.3f}).x == 0);
}

TEST_CASE("Any coordinate gives a finite colour of the texture", "[texture]") {
    Scene s = texture_scene(3, 5, [](uint32_t x, uint32_t y) { return 0.1f * float(x + y); });
    const float bad[] = {NAN,    INFINITY,    -INFINITY, 3e38f, -3e38f,      1e10f,
                         -1e10f, 16777217.0f, -1e-30f,   1.0f,  0.99999994f, 0.5f};
    for (WrapMode wrap : {WrapMode::repeat, WrapMode::mirror, WrapMode::clamp})
        for (TextureFilter filter : {TextureFilter::nearest, TextureFilter::bilinear})
            for (float u : bad)
                for (float v : bad) {
                    s.textures[0].wrap = wrap;
                    s.textures[0].filter = filter;
                    const float value = lookup(s, {u, v});
                    REQUIRE((value >= 0.0f && value <= 0.7f));
                    const Vec2f g = texture_height_gradient<kAll>(view_of(s), s.textures[0], {u, v});
                    REQUIRE((std::isfinite(g.x) && std::isfinite(g.y)));
                }
}
