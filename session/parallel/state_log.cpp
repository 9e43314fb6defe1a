#include "session/parallel/state_log.h"

namespace ambilux {

void StateLog::add(size_t first, std::vector<RangeState> states) {
    for (RangeState& s : states) later_.at(first + s.device).push_back(std::move(s));
}

const DeviceStates& StateLog::saved(const MergeTree& films) {
    for (size_t device = 0; device < saved_.size(); ++device)
        for (auto& later = later_[device]; !later.empty() && films.has(later.front().range); later.pop_front())
            saved_[device] = std::move(later.front().state);
    return saved_;
}

}  // namespace ambilux
