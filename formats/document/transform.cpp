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

double dot(Vec3d a, Vec3d b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec3d cross(Vec3d a, Vec3d b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double length(Vec3d a) { return std::sqrt(dot(a, a)); }
Vec3d transformed(const Matrix& a, Vec3d p, double w) {
    const auto row = [&](int i) { return a.m[i][0] * p.x + a.m[i][1] * p.y + a.m[i][2] * p.z + w * a.m[i][3]; };
    return {row(0), row(1), row(2)};
}

Vec3d column(const Matrix& a, int i) { return {a.m[0][i], a.m[1][i], a.m[2][i]}; }

Matrix look_at(Vec3d origin, Vec3d target, Vec3d up, bool& valid) {
    const auto unit = [](Vec3d v) {
        const double l = length(v);
        return Vec3d{v.x / l, v.y / l, v.z / l};
    };
    const Vec3d dir = unit({target.x - origin.x, target.y - origin.y, target.z - origin.z});
    const Vec3d left = unit(cross(up, dir)), new_up = cross(dir, left);
    valid = std::isfinite(left.x + left.y + left.z + dir.x + dir.y + dir.z);
    Matrix a;
    const Vec3d columns[4] = {left, new_up, dir, origin};
    for (int j = 0; j < 4; ++j) a.m[0][j] = columns[j].x, a.m[1][j] = columns[j].y, a.m[2][j] = columns[j].z;
    return a;
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

bool is_orthogonal(const Matrix& a, double tolerance) {
    for (int i = 0; i < 3; ++i) {
        const Vec3d p = column(a, i), q = column(a, (i + 1) % 3);
        if (!(std::fabs(dot(p, q)) <= tolerance * length(p) * length(q))) return false;
    }
    return true;
}

}  // namespace ambilux::document
