#include "formats/pbrt/cut_quadrics.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace ambilux::pbrt {

namespace {

/// Cells of a whole turn, and of half a turn from pole to pole.
constexpr double kTurn = 256, kHalfTurn = 128;

/// Angle of rotation in radians.
double turn_of(const Parameters& in) { return std::clamp(in.number("phimax", 360), 0.0, 360.0) * (M_PI / 180); }

/// Grid of nu times nv cells; the outside is where (u,v) runs counter-clockwise.
Mesh grid(uint32_t nu, uint32_t nv, const std::function<void(double u, double v, Vec3d& p, Vec3d& n)>& at) {
    Mesh out;
    for (uint32_t j = 0; j <= nv; ++j)
        for (uint32_t i = 0; i <= nu; ++i) {
            const double u = double(i) / nu, v = double(j) / nv;
            Vec3d p{}, n{};
            at(u, v, p, n);
            out.positions.push_back(rounded(p));
            out.normals.push_back(rounded(n));
            out.uvs.push_back({float(u), float(v)});
        }
    add_grid_faces(out, 0, nu, nv);
    return out;
}

}  // namespace

bool is_cut(const Parameters& in) {
    const auto differs = [&](const char* name, double value) {
        return std::fabs(in.number(name, value) - value) > 1e-6 * std::max(std::fabs(value), 1.0);
    };
    if (differs("phimax", 360)) return true;
    const double radius = in.number("radius", 1);
    if (in.type == "sphere")
        return in.number("zmin", -radius) > -radius * (1 - 1e-6) || in.number("zmax", radius) < radius * (1 - 1e-6);
    return in.type == "disk" && differs("innerradius", 0);
}

Mesh cut_quadric(const Parameters& in, double& area) {
    const double radius = in.number("radius", 1), turn = turn_of(in);
    if (!(radius > 0)) fail(in.where_of("radius"), "radius must be positive");
    if (!(turn > 0)) fail(in.where_of("phimax"), "phimax must be positive");
    const uint32_t nu = uint32_t(std::max(std::ceil(kTurn * turn / (2 * M_PI)), 1.0));
    if (in.type == "sphere") {
        const double a = in.number("zmin", -radius), b = in.number("zmax", radius),
                     low = std::clamp(std::min(a, b), -radius, radius),
                     high = std::clamp(std::max(a, b), -radius, radius);
        if (!(high > low)) fail(in.where, "a sphere needs a height: zmin equals zmax");
        area = turn * radius * (high - low);
        const double first = std::acos(low / radius), last = std::acos(high / radius);
        const uint32_t nv = uint32_t(std::max(std::ceil(kHalfTurn * (first - last) / M_PI), 1.0));
        return grid(nu, nv, [&](double u, double v, Vec3d& p, Vec3d& n) {
            const double theta = first + v * (last - first), phi = u * turn;
            n = {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
            p = n * radius;
        });
    }
    if (in.type == "disk") {
        const double inner = in.number("innerradius", 0), height = in.number("height", 0);
        if (!(inner >= 0 && inner < radius)) fail(in.where_of("innerradius"), "innerradius must be less than radius");
        area = turn / 2 * (radius * radius - inner * inner);
        return grid(nu, 1, [&](double u, double v, Vec3d& p, Vec3d& n) {
            const double r = (1 - v) * radius + v * inner, phi = u * turn;
            p = {r * std::cos(phi), r * std::sin(phi), height};
            n = {0, 0, 1};
        });
    }
    const double a = in.number("zmin", -1), b = in.number("zmax", 1), low = std::min(a, b), high = std::max(a, b);
    if (!(high > low)) fail(in.where, "a cylinder needs a length: zmin equals zmax");
    area = turn * radius * (high - low);
    return grid(nu, 1, [&](double u, double v, Vec3d& p, Vec3d& n) {
        const double phi = u * turn;
        n = {std::cos(phi), std::sin(phi), 0};
        p = {radius * n.x, radius * n.y, low + v * (high - low)};
    });
}

}  // namespace ambilux::pbrt
