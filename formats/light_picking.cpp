#include "formats/light_picking.h"

#include <algorithm>

namespace ambilux {

namespace {

/// Raises the weakest emitters of a group and makes its weights add up to one. False if the group is dark.
bool normalize_group(std::vector<double>& power, const std::vector<bool>& infinite, bool group, double& total) {
    const auto members = [&](const auto& visit) {
        for (size_t i = 0; i < power.size(); ++i)
            if (infinite[i] == group && power[i] > 0) visit(power[i]);
    };
    total = 0;
    size_t count = 0;
    members([&](double p) { total += p, ++count; });
    if (count == 0) return false;
    const double least = total * std::min(kLeastEmitterShare, kMostForLeastShares / double(count));
    double raised = 0;
    members([&](double& p) { raised += p = std::max(p, least); });
    members([&](double& p) { p /= raised; });
    return true;
}

}  // namespace

std::vector<double> picking_weights(std::vector<double> power, const std::vector<bool>& infinite,
                                    LightPicking picking) {
    if (picking == LightPicking::uniform) {
        for (double& p : power) p = p > 0 ? 1 : 0;
        return power;
    }
    double finite_total = 0, infinite_total = 0;
    const bool has_finite = normalize_group(power, infinite, false, finite_total),
               has_infinite = normalize_group(power, infinite, true, infinite_total);
    if (!has_finite || !has_infinite) return power;
    const double share =
        std::clamp(infinite_total / (finite_total + infinite_total), kLeastGroupShare, 1 - kLeastGroupShare);
    for (size_t i = 0; i < power.size(); ++i) power[i] *= infinite[i] ? share : 1 - share;
    return power;
}

}  // namespace ambilux
