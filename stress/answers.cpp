#include "stress/answers.h"

#include <boost/math/quadrature/gauss.hpp>
#include <cmath>

namespace ambilux::stress {

double geometric_sum(double q, int terms) {
    double sum = 0, power = 1;
    for (int i = 0; i < terms; ++i, power *= q) sum += power;
    return sum;
}

double integral(const std::function<double(double)>& f, double from, double to, int parts) {
    double sum = 0;
    const double step = (to - from) / parts;
    for (int i = 0; i < parts; ++i)
        sum += boost::math::quadrature::gauss<double, 30>::integrate(f, from + i * step, from + (i + 1) * step);
    return sum;
}

namespace {

/// Of a rectangle with one corner above the point, sides A·h and B·h; odd in both.
double corner_form_factor(double a, double b) {
    const double u = std::sqrt(1 + a * a), v = std::sqrt(1 + b * b);
    return (a / u * std::atan(b / u) + b / v * std::atan(a / v)) / (2 * M_PI);
}

}  // namespace

double rectangle_form_factor(double x, double y, double a, double b, double h) {
    const double x0 = (-a - x) / h, x1 = (a - x) / h, y0 = (-b - y) / h, y1 = (b - y) / h;
    return corner_form_factor(x1, y1) - corner_form_factor(x0, y1) - corner_form_factor(x1, y0) +
           corner_form_factor(x0, y0);
}

double mean_rectangle_form_factor(double half, double a, double b, double h) {
    const auto along_y = [&](double x) {
        return integral([&](double y) { return rectangle_form_factor(x, y, a, b, h); }, -half, half);
    };
    return integral(along_y, -half, half) / (4 * half * half);
}

double square_solid_angle(double half, double h) {
    return 4 * std::atan(half * half / (h * std::sqrt(h * h + 2 * half * half)));
}

double integrating_sphere(double rho, double r, int max_depth) {
    return rho * r * r * geometric_sum(rho * (1 - r * r), max_depth - 1);
}

double furnace(double rho, int max_depth) { return geometric_sum(rho, max_depth); }

}  // namespace ambilux::stress
