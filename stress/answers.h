// Closed forms of the stress scenes, in double precision. Lengths in scene units, radiance in W/(m² sr).
#pragma once

#include <functional>

namespace ambilux::stress {

/// 1 + q + ... + q^(terms-1).
double geometric_sum(double q, int terms);

/// Integral of f over [from, to] by 30 Gauss-Legendre points in each of `parts` equal parts.
double integral(const std::function<double(double)>& f, double from, double to, int parts = 1);

/// Irradiance over pi·radiance at the point (x, y, 0), normal +z, by a rectangle |X| <= a, |Y| <= b in the plane z = h
/// that faces down: the form factor of Howell, "A catalog of radiation heat transfer configuration factors", B-4, for
/// four corners.
double rectangle_form_factor(double x, double y, double a, double b, double h);

/// Mean of rectangle_form_factor over |x|, |y| <= half.
double mean_rectangle_form_factor(double half, double a, double b, double h);

/// Solid angle of the square |x|, |y| <= half from a point at height h above its centre.
double square_solid_angle(double half, double h);

/// Radiance of the wall of a sphere of radius 1, reflectance rho, with a black lamp of radius r and radiance 1 in its
/// centre, by paths of up to max_depth segments: the irradiance of a spherical cavity is the same everywhere, and the
/// lamp catches r² of what the wall sends out.
double integrating_sphere(double rho, double r, int max_depth);

/// Radiance inside of a closed body whose walls send out 1 and reflect rho, by paths of up to max_depth segments.
double furnace(double rho, int max_depth);

}  // namespace ambilux::stress
