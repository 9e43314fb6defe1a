#include "scene/alias_table.h"

#include <algorithm>
#include <cmath>

namespace ambilux {

std::vector<uint32_t> deal_tickets(const std::vector<double>& weights) {
    double total = 0;
    for (double w : weights) total += w;
    const bool dark = !(total > 0);
    if (dark) total = double(weights.size());
    const auto weight = [&](size_t i) { return dark ? 1.0 : weights[i]; };
    uint32_t positive = 0;
    for (size_t i = 0; i < weights.size(); ++i) positive += weight(i) > 0;
    // One for each positive weight; the others go by differences of the rounded cumulative sum, so that nothing is left
    // over.
    const double rest = double(kTickets - positive);
    std::vector<uint32_t> tickets(weights.size(), 0);
    double sum = 0;
    uint32_t dealt = 0;
    for (size_t i = 0; i < weights.size(); ++i) {
        if (!(weight(i) > 0)) continue;
        sum += weight(i);
        const uint32_t up_to_here = uint32_t(std::floor(std::min(sum / total, 1.0) * rest + 0.5));
        tickets[i] = 1 + up_to_here - dealt;
        dealt = up_to_here;
    }
    return tickets;
}

std::vector<AliasBucket> make_alias_table(std::vector<uint32_t> left) {
    const uint32_t n = uint32_t(left.size());
    // First ticket of a bucket: the inverse of bucket_of.
    const auto first = [n](uint32_t i) { return uint32_t((uint64_t(i) * kTickets + n - 1) / n); };
    const auto size = [&](uint32_t i) { return first(i + 1) - first(i); };
    std::vector<AliasBucket> table(n);
    std::vector<uint32_t> small, large;
    const auto sort = [&](uint32_t i) {
        if (left[i] == size(i))
            table[i] = {first(i + 1), i};
        else
            (left[i] < size(i) ? small : large).push_back(i);
    };
    for (uint32_t i = 0; i < n; ++i) sort(i);
    // All counts are whole, so that the unfinished ones always average to a bucket: while one is short, another has
    // more.
    while (!small.empty()) {
        const uint32_t s = small.back(), l = large.back();
        small.pop_back();
        large.pop_back();
        table[s] = {first(s) + left[s], l};
        left[l] -= size(s) - left[s];
        sort(l);
    }
    return table;
}

}  // namespace ambilux
