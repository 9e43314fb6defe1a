#include "formats/document/transform.h"

#include <cmath>

namespace ambilux::document {

Matrix operator*(const Matrix& a, const Matrix& b) {
    Matrix c;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) {
            c.m[i][j] = 0;
            for (int k = 0; k < 4; ++k) c.m[i][j] += a.m[i][k] * b.m[k][j];
        }
    return c;
}

Matrix translation(double x, double y, double z) {
    Matrix a;
    a.m[0][3] = x, a.m[1][3] = y, a.m[2][3] = z;
    return a;
}

Matrix scaling(double x, double y, double z) {
    Matrix a;
    a.m[0][0] = x, a.m[1][1] = y, a.m[2][2] = z;
    return a;
}

Matrix rotation(double x, double y, double z, double degrees) {
    // Rodrigues: cos·I + sin·[n]x + (1-cos)·n·nT.
    const double l = std::sqrt(x * x + y * y + z * z), radians = degrees * (M_PI / 180);
    const double n[3] = {x / l, y / l, z / l}, c = std::cos(radians), s = std::sin(radians);
    const double skew[3][3] = {{0, -n[2], n[1]}, {n[2], 0, -n[0]}, {-n[1], n[0], 0}};
    Matrix a;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) a.m[i][j] = (i == j ? c : 0) + s * skew[i][j] + (1 - c) * n[i] * n[j];
    return a;
}

Vec3d transformed(const Matrix& a, Vec3d p, double w) {
    const auto row = [&](int i) { return a.m[i][0] * p.x + a.m[i][1] * p.y + a.m[i][2] * p.z + w * a.m[i][3]; };
    return {row(0), row(1), row(2)};
}

Vec3d column(const Matrix& a, int i) { return {a.m[0][i], a.m[1][i], a.m[2][i]}; }

Matrix from_columns(Vec3d x, Vec3d y, Vec3d z, Vec3d origin) {
    Matrix a;
    const Vec3d columns[4] = {x, y, z, origin};
    for (int j = 0; j < 4; ++j) a.m[0][j] = columns[j].x, a.m[1][j] = columns[j].y, a.m[2][j] = columns[j].z;
    return a;
}

Matrix without_place(Matrix m) {
    for (int i = 0; i < 3; ++i) m.m[i][3] = 0;
    return m;
}

Matrix unscaled(Matrix m) {
    const double scale = std::cbrt(std::fabs(determinant(m)));
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) m.m[i][j] /= scale > 0 ? scale : 1;
    return m;
}

Matrix look_at(Vec3d origin, Vec3d target, Vec3d up, bool& valid) {
    const Vec3d dir = unit(target - origin), left = unit(cross(up, dir)), new_up = cross(dir, left);
    valid = std::isfinite(left.x + left.y + left.z + dir.x + dir.y + dir.z);
    return from_columns(left, new_up, dir, origin);
}

double determinant(const Matrix& a) { return dot(column(a, 0), cross(column(a, 1), column(a, 2))); }

Matrix affine_inverse(const Matrix& a) {
    const Vec3d c0 = column(a, 0), c1 = column(a, 1), c2 = column(a, 2), t = column(a, 3);
    const double inv = 1 / determinant(a);
    const Vec3d rows[3] = {cross(c1, c2), cross(c2, c0), cross(c0, c1)};
    Matrix r;
    for (int i = 0; i < 3; ++i) {
        const Vec3d row = {rows[i].x * inv, rows[i].y * inv, rows[i].z * inv};
        r.m[i][0] = row.x, r.m[i][1] = row.y, r.m[i][2] = row.z, r.m[i][3] = -dot(row, t);
    }
    return r;
}

Affine to_affine(const Matrix& a) {
    Affine out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) out.m[i][j] = float(a.m[i][j]);
    return out;
}

bool is_affine(const Matrix& a) {
    for (const auto& row : a.m)
        for (double v : row)
            if (!std::isfinite(v)) return false;
    return a.m[3][0] == 0 && a.m[3][1] == 0 && a.m[3][2] == 0 && a.m[3][3] == 1;
}

bool keeps_round(const Matrix& a, bool is_sphere) {
    constexpr double kTolerance = 1e-3;
    const double lx = length(column(a, 0)), ly = length(column(a, 1)), lz = length(column(a, 2)),
                 radius = is_sphere ? (lx + ly + lz) / 3 : (lx + ly) / 2;
    const auto is_radius = [&](double l) { return std::fabs(l - radius) < kTolerance * radius; };
    return is_orthogonal(a, kTolerance) && is_radius(lx) && is_radius(ly) && (!is_sphere || is_radius(lz));
}

bool is_orthogonal(const Matrix& a, double tolerance) {
    for (int i = 0; i < 3; ++i) {
        const Vec3d p = column(a, i), q = column(a, (i + 1) % 3);
        if (!(std::fabs(dot(p, q)) <= tolerance * length(p) * length(q))) return false;
    }
    return true;
}

}  // namespace ambilux::document
