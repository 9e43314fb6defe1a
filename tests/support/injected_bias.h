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

/// Whether the comparison of `a` and `b` fails once `a` is too bright by `relative`, and once it is too dark by it.
inline bool sees_bias(const Estimate& a, const Estimate& b, double relative, const ZTestOptions& options = {}) {
    return !z_test(scaled(a, 1 + relative), b, options).pass && !z_test(scaled(a, 1 - relative), b, options).pass;
}

}  // namespace ambilux
