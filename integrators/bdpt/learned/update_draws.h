// learn_draws: what draws have brought becomes how the next ones draw.
#pragma once

#include "integrators/bdpt/learned/draws.h"

namespace ambilux {

/// The tickets of a cell: in proportion to the root of what it has summed up, and, since a cell may know little yet, of
/// what a group of neighbours has.
struct UpdateDraws {
    static constexpr const char* kName = "learn_draws";
    static constexpr uint32_t kGroupBits = 3;
    static constexpr float kOwn = 0.6f;  ///< how much the cell's own sums count

    DrawTable table;
    const WaveState* state;
    float share;  ///< of draws that follow what was learned
    StageRecord* record;

    /// The table changes after 1, 2, 4, 8, 16 samples of a pixel and then after every 16.
    AMBILUX_HD bool is_due() const {
        const uint32_t before = state->first_sample, now = before + state->samples;
        return (now & (now - 1)) == 0 || now / kOften != before / kOften;
    }

    /// Of a group of cells.
    AMBILUX_HD void operator()(uint32_t group) const {
        if (!is_due()) return;
        const uint32_t first = group << kGroupBits, clusters = table.clusters.leaves();
        float own_totals[kGroup] = {}, totals[kGroup] = {}, sums[kGroup] = {}, group_total = 0.0f;
        for (uint32_t k = 0; k < clusters; ++k)
            for (uint32_t c = 0; c < kGroup; ++c) own_totals[c] += score(first + c, k);
        for (const float t : own_totals) group_total += t;
        if (!(group_total > 0.0f)) return;
        const auto for_weights = [&](auto&& use) {
            for (uint32_t k = 0; k < clusters; ++k) {
                float own[kGroup], of_group = 0.0f;
                for (uint32_t c = 0; c < kGroup; ++c) of_group += own[c] = score(first + c, k);
                const float shared = (1.0f - kOwn) / group_total * of_group;
                for (uint32_t c = 0; c < kGroup; ++c)
                    use(c, k, sqrtf(shared + (own[c] > 0.0f ? kOwn / own_totals[c] * own[c] : 0.0f)));
            }
        };
        for_weights([&](uint32_t c, uint32_t, float weight) { totals[c] += weight; });
        for_weights([&](uint32_t c, uint32_t k, float weight) {
            sums[c] += weight;
            table.tickets[table.row(first + c) + k] =
                uint16_t(share * float(DrawTable::kTickets - 1) / totals[c] * sums[c]);
        });
    }

private:
    static constexpr uint32_t kOften = 16, kGroup = 1u << kGroupBits;

    AMBILUX_HD float score(uint32_t cell, uint32_t k) const { return float(table.sums[table.row(cell) + k]); }
};

}  // namespace ambilux
