// Tail probabilities for statistical tests, by Boost.Math. Double precision, accurate far into the tails. A NaN gives
// a NaN.
#pragma once

namespace ambilux {

/// P(Z > z) of the standard normal distribution.
double normal_tail(double z);

/// z with P(Z > z) = p, for 0 < p < 1; infinity at 0.
double normal_tail_inverse(double p);

/// P(X > x) of the chi-square distribution with `dof` > 0 degrees of freedom.
double chi_square_tail(double x, double dof);

/// P(T > t) of Student's t distribution with `dof` > 0 degrees of freedom (need not be an integer).
double student_tail(double t, double dof);

/// t with P(T > t) = p, for 0 < p < 1; infinity at 0, NaN without degrees of freedom. Infinitely many are the normal
/// distribution.
double student_tail_inverse(double p, double dof);

/// Chance that the smallest of `tests` independent p-values is at most `p` (Sidak 1967): 1-(1-p)^tests.
double sidak(double p, double tests);

/// Level for each of `tests` tests such that all together have level `alpha`: 1-(1-alpha)^(1/tests).
double sidak_level(double alpha, double tests);

}  // namespace ambilux
