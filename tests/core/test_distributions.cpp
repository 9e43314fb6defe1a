// libs: ambilux_core
// Tail probabilities (core/distributions.h) against tables, and what becomes of arguments at the edges.
#include "core/distributions.h"

#include <cmath>
#include <limits>

#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("tail probabilities match tables") {
    CHECK(normal_tail(1.959963984540054) == Approx(0.025).epsilon(1e-12));
    CHECK(normal_tail(6) == Approx(9.865876450376946e-10).epsilon(1e-10));
    CHECK(normal_tail_inverse(1e-9) == Approx(5.9978070150076865).epsilon(1e-10));
    CHECK(normal_tail_inverse(0.9) == Approx(-1.2815515655446004).epsilon(1e-10));
    CHECK(chi_square_tail(3.841458820694124, 1) == Approx(0.05).epsilon(1e-10));
    CHECK(chi_square_tail(124.34211340400407, 100) == Approx(0.05).epsilon(1e-9));
    CHECK(chi_square_tail(2, 2) == Approx(std::exp(-1.0)).epsilon(1e-12));
    CHECK(student_tail(1, 1) == Approx(0.25).epsilon(1e-12));  // Cauchy
    CHECK(student_tail(2.2281388519649385, 10) == Approx(0.025).epsilon(1e-10));
    CHECK(student_tail(-2.2281388519649385, 10) == Approx(0.975).epsilon(1e-10));
    CHECK(student_tail(5, 1e9) == Approx(normal_tail(5)).epsilon(1e-6));
    CHECK(student_tail_inverse(0.025, 10) == Approx(2.2281388519649385).epsilon(1e-10));
    CHECK(student_tail_inverse(0.975, 10) == Approx(-2.2281388519649385).epsilon(1e-10));
    CHECK(student_tail_inverse(1e-9, 1e9) == Approx(5.9978070150076865).epsilon(1e-6));
    for (const double dof : {1.0, 31.0, 45.3, 4096.0})
        for (const double p : {1e-12, 4e-6, 0.01})
            CHECK(student_tail(student_tail_inverse(p, dof), dof) == Approx(p).epsilon(1e-8));
    CHECK(sidak(sidak_level(0.01, 1000), 1000) == Approx(0.01).epsilon(1e-12));
}

TEST_CASE("tail probabilities at the edges are numbers, infinities or NaN, and no exceptions") {
    const double infinity = std::numeric_limits<double>::infinity(), nan = std::nan("");
    CHECK(normal_tail_inverse(0) == infinity);
    CHECK(normal_tail_inverse(1) == -infinity);
    CHECK(normal_tail_inverse(1e-320) == Approx(38.27).epsilon(1e-3));
    CHECK(student_tail(infinity, 5) == 0);
    CHECK(student_tail(-infinity, 5) == 1);
    CHECK(student_tail(2, infinity) == Approx(normal_tail(2)).epsilon(1e-12));
    CHECK(student_tail_inverse(0, 5) == infinity);
    CHECK(student_tail_inverse(0.025, infinity) == Approx(1.959963984540054).epsilon(1e-12));
    CHECK(chi_square_tail(0, 4) == 1);
    CHECK(chi_square_tail(infinity, 4) == 0);
    for (const double x : {normal_tail(nan), normal_tail_inverse(nan), chi_square_tail(nan, 4), student_tail(nan, 5),
                           student_tail(2, nan), student_tail(2, 0), student_tail_inverse(0.1, 0)})
        CHECK(std::isnan(x));
}
