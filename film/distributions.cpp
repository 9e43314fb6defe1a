#include "film/distributions.h"

#include <cmath>
#include <initializer_list>
#include <limits>

namespace ambilux {
namespace {

constexpr double kTiny = 1e-300;
constexpr double kEpsilon = 1e-15;
constexpr int kMaxTerms = 100000;

/// Regularised upper incomplete gamma function Q(a, x): series for x < a+1, else continued fraction by Lentz's method
/// (DLMF 8.7.1 and 8.9.2).
double gamma_q(double a, double x) {
    if (x <= 0) return 1;
    const double log_scale = a * std::log(x) - x - std::lgamma(a);
    if (x < a + 1) {
        double term = 1 / a, sum = term;
        for (int n = 1; n < kMaxTerms && term > kEpsilon * sum; ++n) {
            term *= x / (a + n);
            sum += term;
        }
        return 1 - sum * std::exp(log_scale);
    }
    double b = x + 1 - a, c = 1 / kTiny, d = 1 / b, f = d;
    for (int n = 1; n < kMaxTerms; ++n) {
        const double an = -n * (n - a);
        b += 2;
        d = an * d + b;
        c = b + an / c;
        if (std::abs(d) < kTiny) d = kTiny;
        if (std::abs(c) < kTiny) c = kTiny;
        d = 1 / d;
        f *= c * d;
        if (std::abs(c * d - 1) < kEpsilon) break;
    }
    return f * std::exp(log_scale);
}

/// Regularised incomplete beta function I_x(a, b), continued fraction by Lentz's method (DLMF 8.17.22); x, y = 1-x
/// given apart so that neither loses digits.
double beta_i(double x, double y, double a, double b) {
    if (x <= 0) return 0;
    if (y <= 0) return 1;
    if (x > (a + 1) / (a + b + 2)) return 1 - beta_i(y, x, b, a);
    double c = 1, d = 1 - (a + b) * x / (a + 1);
    if (std::abs(d) < kTiny) d = kTiny;
    d = 1 / d;
    double f = d;
    for (int m = 1; m < kMaxTerms; ++m) {
        const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
        const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
        double change = 1;
        for (const double numerator : {even, odd}) {
            d = 1 + numerator * d;
            c = 1 + numerator / c;
            if (std::abs(d) < kTiny) d = kTiny;
            if (std::abs(c) < kTiny) c = kTiny;
            d = 1 / d;
            change = c * d;
            f *= change;
        }
        if (std::abs(change - 1) < kEpsilon) break;
    }
    const double log_scale =
        a * std::log(x) + b * std::log(y) + std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) - std::log(a);
    return f * std::exp(log_scale);
}

}  // namespace

double normal_tail(double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); }

double normal_tail_inverse(double p) {
    if (p <= 0) return std::numeric_limits<double>::infinity();
    if (p > 0.5) return -normal_tail_inverse(1 - p);
    // Bisection on a decreasing function; 200 halvings reach the last bit.
    double lo = 0, hi = 40;
    for (int i = 0; i < 200 && hi - lo > 1e-14 * hi; ++i) {
        const double mid = 0.5 * (lo + hi);
        (normal_tail(mid) > p ? lo : hi) = mid;
    }
    return 0.5 * (lo + hi);
}

double chi_square_tail(double x, double dof) { return gamma_q(0.5 * dof, 0.5 * x); }

double student_tail(double t, double dof) {
    if (std::isinf(t)) return t > 0 ? 0 : 1;
    // P(|T| > t) = I_{dof/(dof+t²)}(dof/2, 1/2) (DLMF 8.17.20).
    const double t2 = t * t, both = beta_i(dof / (dof + t2), t2 / (dof + t2), 0.5 * dof, 0.5);
    return t >= 0 ? 0.5 * both : 1 - 0.5 * both;
}

double sidak(double p, double tests) { return p >= 1 ? 1 : -std::expm1(tests * std::log1p(-p)); }

double sidak_level(double alpha, double tests) { return -std::expm1(std::log1p(-alpha) / tests); }

}  // namespace ambilux
