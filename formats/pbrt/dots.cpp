// Texture "dots" as an image of the unit square of (u,v).
#include <algorithm>
#include <cmath>
#include <utility>

#include "formats/pbrt/textures.h"

namespace ambilux::pbrt {

namespace {

/// Ken Perlin's permutation of 2002, which pbrt takes.
constexpr uint8_t kPermutation[256] = {
    151, 160, 137, 91,  90,  15,  131, 13,  201, 95,  96,  53,  194, 233, 7,   225, 140, 36,  103, 30,  69,  142,
    8,   99,  37,  240, 21,  10,  23,  190, 6,   148, 247, 120, 234, 75,  0,   26,  197, 62,  94,  252, 219, 203,
    117, 35,  11,  32,  57,  177, 33,  88,  237, 149, 56,  87,  174, 20,  125, 136, 171, 168, 68,  175, 74,  165,
    71,  134, 139, 48,  27,  166, 77,  146, 158, 231, 83,  111, 229, 122, 60,  211, 133, 230, 220, 105, 92,  41,
    55,  46,  245, 40,  244, 102, 143, 54,  65,  25,  63,  161, 1,   216, 80,  73,  209, 76,  132, 187, 208, 89,
    18,  169, 200, 196, 135, 130, 116, 188, 159, 86,  164, 100, 109, 198, 173, 186, 3,   64,  52,  217, 226, 250,
    124, 123, 5,   202, 38,  147, 118, 126, 255, 82,  85,  212, 207, 206, 59,  227, 47,  16,  58,  17,  182, 189,
    28,  42,  223, 183, 170, 213, 119, 248, 152, 2,   44,  154, 163, 70,  221, 153, 101, 155, 167, 43,  172, 9,
    129, 22,  39,  253, 19,  98,  108, 110, 79,  113, 224, 232, 178, 185, 112, 104, 218, 246, 97,  228, 251, 34,
    242, 193, 238, 210, 144, 12,  191, 179, 162, 241, 81,  51,  145, 235, 249, 14,  239, 107, 49,  192, 214, 31,
    181, 199, 106, 157, 184, 84,  204, 176, 115, 121, 50,  45,  127, 4,   150, 254, 138, 236, 205, 93,  222, 114,
    67,  29,  24,  72,  243, 141, 128, 195, 78,  66,  215, 61,  156, 180};

uint32_t permuted(int64_t i) { return kPermutation[i & 255]; }

/// Perlin's improved noise in the plane z = 0.5.
double noise(double x, double y) {
    const double fx = std::floor(x), fy = std::floor(y), z = 0.5;
    const int64_t ix = int64_t(fx), iy = int64_t(fy);
    const auto slope = [&](int i, int j, int k) {
        const uint32_t hash = permuted(permuted(permuted(ix + i) + iy + j) + k) & 15;
        const double dx = x - fx - i, dy = y - fy - j, dz = z - k;
        const bool last = hash == 12 || hash == 13;
        const double u = hash < 8 || last ? dx : dy, v = hash < 4 || last ? dy : dz;
        return ((hash & 1) ? -u : u) + ((hash & 2) ? -v : v);
    };
    const auto smooth = [](double t) { return t * t * t * (t * (6 * t - 15) + 10); };
    const double wx = smooth(x - fx), wy = smooth(y - fy), wz = smooth(z);
    const auto plane = [&](int k) {
        return std::lerp(std::lerp(slope(0, 0, k), slope(1, 0, k), wx), std::lerp(slope(0, 1, k), slope(1, 1, k), wx),
                         wy);
    };
    return std::lerp(plane(0), plane(1), wz);
}

bool in_dot(double s, double t) {
    if (!(std::fabs(s) < 1e9 && std::fabs(t) < 1e9)) return false;
    const double cs = std::floor(s + 0.5), ct = std::floor(t + 0.5), radius = 0.35, shift = 0.5 - radius;
    if (!(noise(cs + 0.5, ct + 0.5) > 0)) return false;
    const double x = cs + shift * noise(cs + 1.5, ct + 2.8), y = ct + shift * noise(cs + 4.5, ct + 9.8);
    return (s - x) * (s - x) + (t - y) * (t - y) < radius * radius;
}

}  // namespace

/// 1 inside of dots, 0 outside.
Texture Textures::dots(const Parameters& in) const {
    Texture out;
    out.kind = Texture::Kind::image;
    out.where = in.where;
    set_mapping(out, in);
    if (out.projection) fail(in.where_of("mapping"), "dots are supported with the mapping uv only");
    const UvMap to_cells = std::exchange(out.mapping, UvMap{});
    const double cells = std::max(std::fabs(to_cells.m[0][0]), std::fabs(to_cells.m[1][1]));
    const uint32_t side = uint32_t(std::clamp(64 * cells, 256.0, 2048.0));
    out.wrap = "clamp", out.filter = "nearest";
    out.image = std::make_shared<TextureImage>();
    out.image->is_file = false;
    out.image->width = out.image->height = side;
    out.image->texels.reserve(size_t(side) * side);
    for (uint32_t row = 0; row < side; ++row)
        for (uint32_t column = 0; column < side; ++column) {
            const double u = (column + 0.5) / side, v = 1 - (row + 0.5) / side;
            const double s = to_cells.m[0][0] * u + to_cells.m[0][2], t = to_cells.m[1][1] * v + to_cells.m[1][2];
            out.image->texels.push_back(splat(in_dot(s, t) ? 1.0f : 0.0f));
        }
    report_.note(in.where, "dots are an image of " + std::to_string(side) +
                               " texels a side, which ends at the edges of the unit square of (u,v)");
    return out;
}

}  // namespace ambilux::pbrt
