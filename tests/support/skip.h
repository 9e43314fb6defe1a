// Tests that need a device or data which are not there.
#pragma once

#include <string>

#include "tests/support/catch.h"

namespace ambilux {

/// Read by tests/support/catch_main.cpp: a program whose cases have all been skipped ends with kSkippedExit, which
/// ctest reports as skipped.
struct SkippedCases {
    bool asked = false;  ///< by the case that is running
    int skipped = 0, ran = 0;
};
inline SkippedCases the_skipped_cases;
constexpr int kSkippedExit = 77;

/// Says why the running case ends here, or goes on without a part; it counts as skipped if it has checked nothing.
inline void skip(const std::string& why) {
    the_skipped_cases.asked = true;
    WARN(why);
}

}  // namespace ambilux
