// Texture "dots" as an image of the unit square of (u,v).
#include <algorithm>
#include <cmath>
#include <utility>

#include "formats/pbrt/noise.h"
#include "formats/pbrt/textures.h"

namespace ambilux::pbrt {

namespace {

/// pbrt's noise of two numbers lies in this plane.
double noise_in_plane(double x, double y) { return noise(x, y, 0.5); }

bool in_dot(double s, double t) {
    if (!(std::fabs(s) < 1e9 && std::fabs(t) < 1e9)) return false;
    const double cs = std::floor(s + 0.5), ct = std::floor(t + 0.5), radius = 0.35, shift = 0.5 - radius;
    if (!(noise_in_plane(cs + 0.5, ct + 0.5) > 0)) return false;
    const double x = cs + shift * noise_in_plane(cs + 1.5, ct + 2.8),
                 y = ct + shift * noise_in_plane(cs + 4.5, ct + 9.8);
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
    out.image = made_image(side, side);
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
