#include "core/distributions.h"

#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/erf.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

namespace ambilux {
namespace {

namespace policies = boost::math::policies;

/// Results that do not exist are NaN or infinite instead of exceptions; no long double.
using Policy =
    policies::policy<policies::domain_error<policies::ignore_error>, policies::pole_error<policies::ignore_error>,
                     policies::overflow_error<policies::ignore_error>,
                     policies::evaluation_error<policies::ignore_error>, policies::promote_double<false>>;

}  // namespace

double normal_tail(double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); }

double normal_tail_inverse(double p) { return std::sqrt(2.0) * boost::math::erfc_inv(2 * p, Policy()); }

double chi_square_tail(double x, double dof) { return x <= 0 ? 1 : boost::math::gamma_q(0.5 * dof, 0.5 * x, Policy()); }

double student_tail(double t, double dof) {
    return boost::math::cdf(boost::math::complement(boost::math::students_t_distribution<double, Policy>(dof), t));
}

double student_tail_inverse(double p, double dof) {
    if (std::isinf(dof)) return normal_tail_inverse(p);
    const boost::math::students_t_distribution<double, Policy> t(dof);
    return boost::math::quantile(boost::math::complement(t, p));
}

double sidak(double p, double tests) { return p >= 1 ? 1 : -std::expm1(tests * std::log1p(-p)); }

double sidak_level(double alpha, double tests) { return -std::expm1(std::log1p(-alpha) / tests); }

}  // namespace ambilux
