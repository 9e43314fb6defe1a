// 4x4 matrices in double, for transforms read from files.
#pragma once

#include "core/math.h"
#include "core/vec3d.h"

namespace ambilux::document {

/// Row-major affine or projective 4x4 matrix; points are columns. Identity by default.
struct Matrix {
    double m[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};

    bool operator==(const Matrix&) const = default;
};

Matrix operator*(const Matrix& a, const Matrix& b);
Matrix translation(double x, double y, double z);
Matrix scaling(double x, double y, double z);
/// Rotation by `degrees` around the axis, which need not be unit but not zero.
Matrix rotation(double x, double y, double z, double degrees);
/// The map of the unit vectors to x, y and z, and of the origin to `origin`.
Matrix from_columns(Vec3d x, Vec3d y, Vec3d z, Vec3d origin = {0, 0, 0});
/// Without its translation: of what is infinitely far away.
Matrix without_place(Matrix m);
/// Without the uniform part of its scale, which is nothing to what starts in one point.
Matrix unscaled(Matrix m);
/// Camera frame: columns left, up, direction, origin. `valid` becomes false if the directions are degenerate.
Matrix look_at(Vec3d origin, Vec3d target, Vec3d up, bool& valid);
/// Determinant of the upper left 3x3 block.
double determinant(const Matrix& a);
/// Inverse of an affine matrix with determinant other than 0.
Matrix affine_inverse(const Matrix& a);
Affine to_affine(const Matrix& a);
/// A point (w = 1), or a direction (w = 0); the last row is taken for 0 0 0 1.
Vec3d transformed(const Matrix& a, Vec3d p, double w = 1);
/// Columns of the linear part.
Vec3d column(const Matrix& a, int i);
/// Last row is 0 0 0 1 and all entries are finite.
bool is_affine(const Matrix& a);
/// Takes a sphere, or a cylinder about z, to a sphere or cylinder, but for a tolerance.
bool keeps_round(const Matrix& a, bool is_sphere);
/// The three columns are mutually perpendicular within `tolerance` (cosine).
bool is_orthogonal(const Matrix& a, double tolerance);

}  // namespace ambilux::document
