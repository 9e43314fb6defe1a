// Cumulative tables by which one of n entries is picked with a random float: emitters, triangles of a light.
#pragma once

#include <vector>

#include "scene/alias_table.h"

namespace ambilux {

/// Entries of positive weight that a table can tell apart: each needs a ticket of its own.
constexpr uint64_t kMostPicks = kTickets;

/// Entries that a table of these weights must be able to pick: those of positive weight, or all if none is.
uint64_t count_picks(const std::vector<double>& weights);

/// Table cdf[0] = 0 ... cdf[n] = 1 for sample_cdf (core/sampling.h), from n >= 1 weights that are not negative and of
/// which count_picks <= kMostPicks. All-zero weights count as equal ones.
///
/// Steps are whole tickets (scene/alias_table.h) times 2^-24, so that floats hold the table and its differences without
/// rounding: cdf[i+1] - cdf[i] is the share of all random floats that pick entry i, to the last bit. It is positive
/// where the weight is. One ticket goes to each entry and the rest is dealt in proportion: with n entries probability i
/// is (1 - n/2^24) weight_i/total + 1/2^24, give or take a ticket. Up to a million entries that is proportion; towards
/// kMostPicks it becomes the same for all, which costs variance and nothing else.
std::vector<float> pick_table(const std::vector<double>& weights);

}  // namespace ambilux
