// The nearest of a set of points: a balanced k-d tree in one array (Bentley 1975, "Multidimensional Binary Search Trees
// Used for Associative Searching").
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/math.h"

namespace ambilux {

class NearestPoints {
public:
    NearestPoints() = default;
    explicit NearestPoints(std::vector<Vec3f> points) : points_(std::move(points)), order_(points_.size()) {
        for (uint32_t i = 0; i < order_.size(); ++i) order_[i] = i;
        axis_.resize(order_.size());
        build(0, uint32_t(order_.size()));
    }

    size_t size() const { return points_.size(); }

    /// Squared distance and number of the K nearest to `p` in any order but for the first, which is the farthest. There
    /// must be as many.
    template <size_t K>
    std::array<std::pair<float, uint32_t>, K> nearest(Vec3f p) const {
        std::array<std::pair<float, uint32_t>, K> found;
        found.fill({kInfinity, 0});
        search(p, 0, uint32_t(order_.size()), found);
        return found;
    }

private:
    void build(uint32_t begin, uint32_t end) {
        if (end - begin < 2) return;
        Vec3f lower = points_[order_[begin]], upper = lower;
        for (uint32_t i = begin; i < end; ++i)
            for (int k = 0; k < 3; ++k) {
                lower[k] = std::min(lower[k], points_[order_[i]][k]);
                upper[k] = std::max(upper[k], points_[order_[i]][k]);
            }
        const Vec3f size = upper - lower;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        const uint32_t middle = begin + (end - begin) / 2;
        std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                         [&](uint32_t a, uint32_t b) { return points_[a][axis] < points_[b][axis]; });
        axis_[middle] = uint8_t(axis);
        build(begin, middle);
        build(middle + 1, end);
    }
    template <size_t K>
    void search(Vec3f p, uint32_t begin, uint32_t end, std::array<std::pair<float, uint32_t>, K>& found) const {
        if (begin >= end) return;
        const uint32_t middle = begin + (end - begin) / 2, point = order_[middle];
        const float d2 = length_squared(points_[point] - p);
        if (d2 < found[0].first) {
            std::pop_heap(found.begin(), found.end());
            found.back() = {d2, point};
            std::push_heap(found.begin(), found.end());
        }
        const float beyond = p[axis_[middle]] - points_[point][axis_[middle]];
        const bool lower = beyond < 0.0f;
        lower ? search(p, begin, middle, found) : search(p, middle + 1, end, found);
        if (sqr(beyond) < found[0].first) lower ? search(p, middle + 1, end, found) : search(p, begin, middle, found);
    }

    std::vector<Vec3f> points_;
    std::vector<uint32_t> order_;
    std::vector<uint8_t> axis_;
};

}  // namespace ambilux
