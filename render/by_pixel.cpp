#include "render/by_pixel.h"

#include <algorithm>
#include <numeric>

#include "integrators/bdpt/aware/settings.h"

namespace ambilux {
namespace {

/// Blocks on each side of one over which its figures are means: the pilot has a few samples of each.
constexpr int kRadius = 2;

/// Means over neighbours; `counts`: of the blocks that enter.
std::vector<double> filtered(const std::vector<double>& values, const std::vector<bool>& counts, uint32_t width,
                             uint32_t height) {
    std::vector<double> means(values.size());
    const int w = int(width), h = int(height);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
            double sum = 0, n = 0;
            for (int radius = kRadius; n == 0; ++radius)
                for (int v = std::max(0, y - radius); v <= std::min(h - 1, y + radius); ++v)
                    for (int u = std::max(0, x - radius); u <= std::min(w - 1, x + radius); ++u)
                        if (counts[size_t(v) * width + u]) {
                            sum += values[size_t(v) * width + u];
                            ++n;
                        }
            means[size_t(y) * width + x] = sum / n;
        }
    return means;
}

/// Means over all blocks, each with its option.
struct Totals {
    double variance = 0, work = 0;
};
Totals totals(const BlockFigures& of, const std::vector<uint32_t>& option) {
    Totals t;
    for (size_t b = 0; b < option.size(); ++b) {
        t.variance += of.variance[option[b]][b] / double(option.size());
        t.work += of.work[option[b]][b] / double(option.size());
    }
    return t;
}

/// How many vertices eye vertices draw, all alike: none without connections. -1: it is another estimator.
int draws_of(const SelectionCandidate& c) {
    const SelectionOffer& o = c.offer;
    if (!c.predicted() || o.least_subpaths > 0 || c.pilot.light_subpaths == 0.0f) return -1;
    if (!o.connect) return 0;
    return o.draws > 0 && o.draws == o.worth && o.draws <= 9 ? int(o.draws) : -1;
}

}  // namespace

std::vector<uint32_t> options_by_block(const BlockFigures& of, double unseen) {
    std::vector<bool> counts(of.variance[0].size());
    for (const size_t b : kept_blocks(of.variance)) counts[b] = true;
    BlockFigures smooth = of;
    for (auto* figures : {&smooth.variance, &smooth.work})
        for (std::vector<double>& f : *figures) f = filtered(f, counts, of.width, of.height);
    const auto product = [&](const Totals& t) { return (std::max(t.variance, 0.0) + unseen) * t.work; };
    std::vector<uint32_t> best;
    for (uint32_t start = 0; start < of.variance.size(); ++start) {
        std::vector<uint32_t> option(counts.size(), start);
        // A step that makes the mean of both quotients less makes their geometric mean less.
        for (Totals now = totals(smooth, option);;) {
            std::vector<uint32_t> next = option;
            for (size_t b = 0; b < next.size(); ++b)
                for (uint32_t o = 0; o < of.variance.size(); ++o) {
                    const auto cost = [&](uint32_t i) {
                        return smooth.variance[i][b] / (std::max(now.variance, 0.0) + unseen) +
                               smooth.work[i][b] / now.work;
                    };
                    if (cost(o) < cost(next[b])) next[b] = o;
                }
            const Totals then = totals(smooth, next);
            if (!(product(then) < product(now) * (1.0 - 1e-9))) break;
            option = std::move(next);
            now = then;
        }
        if (best.empty() || product(totals(smooth, option)) < product(totals(smooth, best))) best = std::move(option);
    }
    return best;
}

double set_connections_map(SelectionCandidate& by_pixel, const std::vector<SelectionCandidate>& all,
                           const std::vector<std::string>& excluded, bool cuda, double unseen, Pilot& pilot) {
    BlockFigures figures = {pilot.blocks_x, pilot.blocks_y, {}, {}};
    std::vector<uint16_t> draws;
    for (size_t c = 0; c < all.size(); ++c) {
        if (draws_of(all[c]) < 0 || !excluded[c].empty() ||
            all[c].pilot.light_subpaths != by_pixel.pilot.light_subpaths)
            continue;
        draws.push_back(uint16_t(draws_of(all[c])));
        figures.variance.push_back(pilot.variance[c]);
        figures.work.emplace_back();
        for (const PilotWork& w : pilot.block_work)
            figures.work.back().push_back(by_pixel.offer.work * selection_work(w, all[c], cuda));
    }
    std::vector<double>& variance = pilot.variance.emplace_back(pilot.blocks_x * pilot.blocks_y, 0.0);
    if (draws.size() < 2) return 0.0;
    const std::vector<uint32_t> option = options_by_block(figures, unseen);
    ConnectionsMap map = {pilot.blocks_x, pilot.blocks_y, {}};
    for (size_t b = 0; b < option.size(); ++b) {
        variance[b] = figures.variance[option[b]][b];
        map.counts.push_back(draws[option[b]]);
    }
    if (map.least() == map.most()) return 0.0;
    by_pixel.settings.emplace_back("connections_map", map.text());
    return totals(figures, option).work;
}

}  // namespace ambilux
