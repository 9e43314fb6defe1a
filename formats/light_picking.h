// How light sampling chooses among emitters.
#pragma once

#include <cstdint>
#include <vector>

namespace ambilux {

enum class LightPicking : uint32_t {
    power,
    uniform,
    tree,  ///< as power; renders shall pick by a tree besides (setting light_picking)
};
inline const char* name_of(LightPicking picking) {
    constexpr const char* kNames[] = {"power", "uniform", "tree"};
    return kNames[uint32_t(picking)];
}

/// Share of all picks that finite emitters get at least, and that emitters at infinity get at least, where there are
/// both. Powers of the two do not compare: how much light comes from infinity depends on how the scene is closed, which
/// no bound knows. A group gets at least this share, so that variance is at most that of the right share over it, and
/// the other group loses little.
constexpr double kLeastGroupShare = 0.125;

/// Least share of its group's power with which an emitter that shines is picked, and the most that all of these least
/// shares take of the group.
constexpr double kLeastEmitterShare = 1e-6, kMostForLeastShares = 0.01;

/// What emitters are picked in proportion to. `power`: of each emitter, watts in luminance, 0 where it is black.
/// `infinite`: which of them are at infinity.
std::vector<double> picking_weights(std::vector<double> power, const std::vector<bool>& infinite, LightPicking picking);

}  // namespace ambilux
