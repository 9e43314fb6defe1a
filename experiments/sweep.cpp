#include "experiments/sweep.h"

namespace ambilux {

std::vector<std::vector<SweepValue>> combinations(const Sweep& sweep) {
    std::vector<std::vector<SweepValue>> all = {{}};
    for (const auto& values : sweep) {
        std::vector<std::vector<SweepValue>> longer;
        for (const auto& combination : all)
            for (const SweepValue& value : values) {
                longer.push_back(combination);
                longer.back().push_back(value);
            }
        all = std::move(longer);
    }
    return all;
}

std::vector<std::vector<SweepValue>> one_at_a_time(const Sweep& sweep) {
    std::vector<std::vector<SweepValue>> all;
    for (const auto& values : sweep)
        for (const SweepValue& value : values) all.push_back({value});
    return all;
}

std::string swept_name(const std::string& base, const std::vector<SweepValue>& values) {
    std::vector<std::string> inner;
    for (const SweepValue& value : values) inner.push_back(fmt::format("{}={}", value.key, value.text));
    return inner.empty() ? base : fmt::format("{}[{}]", base, fmt::join(inner, ","));
}

}  // namespace ambilux
