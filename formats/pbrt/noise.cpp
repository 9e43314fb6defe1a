#include "formats/pbrt/noise.h"

#include <cmath>
#include <cstdint>

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

template <class Function>
double sum_of_octaves(Vec3d p, double omega, int octaves, Function f) {
    double sum = 0, frequency = 1, amplitude = 1;
    for (int i = 0; i < octaves; ++i) {
        sum += amplitude * f(noise(frequency * p.x, frequency * p.y, frequency * p.z));
        frequency *= kLacunarity, amplitude *= omega;
    }
    return sum;
}

}  // namespace

double noise(double x, double y, double z) {
    // Beyond this doubles have no room for what the noise depends on.
    if (!(std::fabs(x) < 1e9 && std::fabs(y) < 1e9 && std::fabs(z) < 1e9)) return 0;
    const double fx = std::floor(x), fy = std::floor(y), fz = std::floor(z);
    const int64_t ix = int64_t(fx), iy = int64_t(fy), iz = int64_t(fz);
    const auto slope = [&](int i, int j, int k) {
        const uint32_t hash = permuted(permuted(permuted(ix + i) + iy + j) + iz + k) & 15;
        const double dx = x - fx - i, dy = y - fy - j, dz = z - fz - k;
        const bool last = hash == 12 || hash == 13;
        const double u = hash < 8 || last ? dx : dy, v = hash < 4 || last ? dy : dz;
        return ((hash & 1) ? -u : u) + ((hash & 2) ? -v : v);
    };
    const auto smooth = [](double t) { return t * t * t * (t * (6 * t - 15) + 10); };
    const double wx = smooth(x - fx), wy = smooth(y - fy), wz = smooth(z - fz);
    const auto plane = [&](int k) {
        return std::lerp(std::lerp(slope(0, 0, k), slope(1, 0, k), wx), std::lerp(slope(0, 1, k), slope(1, 1, k), wx),
                         wy);
    };
    return std::lerp(plane(0), plane(1), wz);
}

double fbm(Vec3d p, double omega, int octaves) {
    return sum_of_octaves(p, omega, octaves, [](double n) { return n; });
}

double turbulence(Vec3d p, double omega, int octaves) {
    // And the mean of the octave that would follow.
    return sum_of_octaves(p, omega, octaves, [](double n) { return std::fabs(n); }) + std::pow(omega, octaves) * 0.2;
}

}  // namespace ambilux::pbrt
