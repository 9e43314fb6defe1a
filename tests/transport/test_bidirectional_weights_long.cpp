// libs: ambilux_formats ambilux_accel ambilux_core
// labels: long
// timeout: 3600
// The comparison of tests/test_bidirectional_weights.cpp over tens of millions of paths.
#include "tests/support/bidirectional_paths.h"

using namespace ambilux::test;

TEST_CASE("Recursive weights equal those of all strategies enumerated, for many millions of paths") {
    compare_weights(20.0, settings);
}
