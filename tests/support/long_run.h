// How much is tried: the first values of a list, or with AMBILUX_LONG=1 (scripts/test.sh) all of them.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

namespace ambilux {

inline bool is_long_run() {
    const char* value = std::getenv("AMBILUX_LONG");
    return value && value == std::string("1");
}

/// `all`, what every run tries first.
template <class T>
std::vector<T> first_or_all(size_t first, std::vector<T> all) {
    if (!is_long_run()) all.erase(all.begin() + long(std::min(first, all.size())), all.end());
    return all;
}

}  // namespace ambilux
