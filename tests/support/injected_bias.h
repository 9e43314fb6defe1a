// Is what a comparison says it would see what it sees? A bias is put in, and it must fail.
#pragma once

#include "film/ztest.h"

namespace ambilux {

/// The estimate of an image that is `factor` times as bright, from the same random numbers.
inline Estimate scaled(Estimate e, double factor) {
    for (size_t i = 0; i < e.mean.size(); ++i) {
        e.mean[i] *= factor;
        e.variance_of_mean[i] *= factor * factor;
    }
    for (std::vector<double>& batch : e.batches)
        for (double& v : batch) v *= factor;
    return e;
}

/// Whether the comparison of `a` and `b` fails once `a` as a whole is brighter than `b` by `relative`, and once it is
/// darker by it. The difference that chance made is taken out first: with it, an image may lie just below the limit on
/// one side.
inline bool sees_bias(const Estimate& a, const Estimate& b, double relative, const ZTestOptions& options = {}) {
    const double level = 1 + z_test(a, b, options).relative_difference;
    return !z_test(scaled(a, (1 + relative) / level), b, options).pass &&
           !z_test(scaled(a, (1 - relative) / level), b, options).pass;
}

}  // namespace ambilux
