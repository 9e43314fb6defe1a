#include "experiments/work_estimate.h"

#include <algorithm>
#include <cmath>

namespace ambilux {

void WorkEstimate::plan(const std::string& kind, double count, Work each) {
    Kind& k = kinds_[kind];
    k.renders += count;
    k.each = each;
}

void WorkEstimate::begin(const std::string& kind, Work left) {
    Kind& k = kinds_[kind];
    k.renders = std::max(0.0, k.renders - 1);
    k.left = left;
}

void WorkEstimate::measured(const std::string& kind, double samples, double seconds) {
    Kind& k = kinds_[kind];
    k.samples += samples;
    k.seconds += seconds;
    samples_ += samples;
    seconds_ += seconds;
}

void WorkEstimate::progress(const std::string& kind, double samples, double seconds) {
    measured(kind, samples, seconds);
    done_ += seconds;
    Work& left = kinds_[kind].left;
    left = {std::max(0.0, left.samples - samples), std::max(0.0, left.seconds - seconds)};
}

void WorkEstimate::end(const std::string& kind) { kinds_[kind].left = {}; }

void WorkEstimate::skip(const std::string& kind) {
    Kind& k = kinds_[kind];
    k.renders = std::max(0.0, k.renders - 1);
}

double WorkEstimate::seconds_of(const Kind& kind, const Work& work) const {
    if (work.samples <= 0) return work.seconds;
    const bool own = kind.samples > 0;
    if (!own && samples_ <= 0) return INFINITY;
    const double cost = own ? kind.seconds / kind.samples : seconds_ / samples_;
    return std::max(work.seconds, work.samples * cost);
}

double WorkEstimate::seconds_left(const std::string& kind) const {
    const auto found = kinds_.find(kind);
    if (found == kinds_.end()) return 0;
    const Kind& k = found->second;
    return seconds_of(k, k.left) + (k.renders > 0 ? k.renders * seconds_of(k, k.each) : 0);
}

double WorkEstimate::seconds_left() const {
    double seconds = 0;
    for (const auto& [name, kind] : kinds_) seconds += seconds_left(name);
    return seconds;
}

double WorkEstimate::fraction() const {
    const double left = seconds_left();
    return std::isinf(left) ? 0 : left <= 0 ? 1 : done_ / (done_ + left);
}

}  // namespace ambilux
