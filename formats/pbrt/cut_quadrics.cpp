#include "formats/pbrt/cut_quadrics.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace ambilux::pbrt {

namespace {

/// Cells of a whole turn, and of half a turn from pole to pole.
constexpr double kTurn = 256, kHalfTurn = 128;

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

QuadricShape read_quadric(const Parameters& in) {
    QuadricShape q;
    q.radius = in.number("radius", 1);
    if (!(q.radius > 0)) fail(in.where_of("radius"), "radius must be positive");
    const double phimax = in.number("phimax", 360), r = q.radius;
    q.turn = std::clamp(phimax, 0.0, 360.0) * (M_PI / 180);
    q.is_cut = std::fabs(phimax - 360) > 360e-6;
    if (!(q.turn > 0)) fail(in.where_of("phimax"), "phimax must be positive");
    if (in.type == "disk") {
        q.inner = in.number("innerradius", 0);
        q.low = q.high = in.number("height", 0);
        q.is_cut |= std::fabs(q.inner) > 1e-6;
        if (q.is_cut && !(q.inner >= 0 && q.inner < r))
            fail(in.where_of("innerradius"), "innerradius must be less than radius");
        q.area = q.turn / 2 * (r * r - q.inner * q.inner);
        return q;
    }
    const bool is_sphere = in.type == "sphere";
    const double a = in.number("zmin", is_sphere ? -r : -1), b = in.number("zmax", is_sphere ? r : 1);
    q.low = std::min(a, b), q.high = std::max(a, b);
    if (is_sphere) {
        q.is_cut |= a > -r * (1 - 1e-6) || b < r * (1 - 1e-6);
        q.low = std::clamp(q.low, -r, r), q.high = std::clamp(q.high, -r, r);
    }
    if (!(q.high > q.low))
        fail(in.where,
             is_sphere ? "a sphere needs a height: zmin equals zmax" : "a cylinder needs a length: zmin equals zmax");
    q.area = q.turn * r * (q.high - q.low);
    return q;
}

Mesh mesh_of_quadric(const std::string& type, const QuadricShape& q) {
    const uint32_t nu = uint32_t(std::max(std::ceil(kTurn * q.turn / (2 * M_PI)), 1.0));
    if (type == "sphere") {
        const double first = std::acos(q.low / q.radius), last = std::acos(q.high / q.radius);
        const uint32_t nv = uint32_t(std::max(std::ceil(kHalfTurn * (first - last) / M_PI), 1.0));
        return grid(nu, nv, [&](double u, double v, Vec3d& p, Vec3d& n) {
            const double theta = first + v * (last - first), phi = u * q.turn;
            n = {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
            p = n * q.radius;
        });
    }
    if (type == "disk")
        return grid(nu, 1, [&](double u, double v, Vec3d& p, Vec3d& n) {
            const double r = (1 - v) * q.radius + v * q.inner, phi = u * q.turn;
            p = {r * std::cos(phi), r * std::sin(phi), q.low};
            n = {0, 0, 1};
        });
    return grid(nu, 1, [&](double u, double v, Vec3d& p, Vec3d& n) {
        const double phi = u * q.turn;
        n = {std::cos(phi), std::sin(phi), 0};
        p = {q.radius * n.x, q.radius * n.y, q.low + v * (q.high - q.low)};
    });
}

}  // namespace ambilux::pbrt
