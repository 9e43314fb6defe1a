#include "scene/pick_table.h"

#include <algorithm>

namespace ambilux {

uint64_t count_picks(const std::vector<double>& weights) {
    const auto positive = std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0; });
    return positive > 0 ? uint64_t(positive) : weights.size();
}

std::vector<float> pick_table(const std::vector<double>& weights) {
    std::vector<float> cdf = {0.0f};
    cdf.reserve(weights.size() + 1);
    uint32_t sum = 0;
    for (uint32_t tickets : deal_tickets(weights)) cdf.push_back(float(sum += tickets) * (1.0f / float(kTickets)));
    return cdf;
}

}  // namespace ambilux
