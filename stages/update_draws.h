// learn_draws: what draws have brought becomes how the next ones draw.
#pragma once

#include "stages/learned_draws.h"

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
        return state->samples >= kOften || (now & (now - 1)) == 0 || now / kOften != before / kOften;
    }

    AMBILUX_HD void operator()(uint32_t cell) const {
        if (!is_due()) return;
        const uint32_t clusters = table.clusters.leaves();
        float own_total = 0.0f, group_total = 0.0f, total = 0.0f;
        for (uint32_t k = 0; k < clusters; ++k) {
            own_total += own(cell, k);
            group_total += group(cell, k);
        }
        if (!(group_total > 0.0f)) return;
        const float a = own_total > 0.0f ? kOwn / own_total : 0.0f, b = (1.0f - kOwn) / group_total;
        const auto weight = [&](uint32_t k) { return sqrtf(a * own(cell, k) + b * group(cell, k)); };
        for (uint32_t k = 0; k < clusters; ++k) total += weight(k);
        const float scale = share * float(DrawTable::kTickets - 1) / total;
        float sum = 0.0f;
        for (uint32_t k = 0; k < clusters; ++k) {
            sum += weight(k);
            table.tickets[table.row(cell) + k] = uint16_t(sum * scale);
        }
    }

private:
    static constexpr uint32_t kOften = 16;

    AMBILUX_HD float own(uint32_t cell, uint32_t k) const { return float(table.sums[table.row(cell) + k]); }
    AMBILUX_HD float group(uint32_t cell, uint32_t k) const {
        float sum = 0.0f;
        for (uint32_t c = cell >> kGroupBits << kGroupBits, n = 0; n < 1u << kGroupBits; ++n) sum += own(c + n, k);
        return sum;
    }
};

}  // namespace ambilux
