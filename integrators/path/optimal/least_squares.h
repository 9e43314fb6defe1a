// The same weights by least squares. With weights of the balance heuristic, a sample Y of a vertex and variates Z_k
// without mean, Y + Σ a_k Z_k has the least variance where the a_k are minus the regression of Y on Z. In the limit
// they are those of densities.h wherever vertices are alike, and the best for vertices that are not; their error goes
// with the variance that is left, not with that which there was.
#pragma once

#include "integrators/path/optimal/strategies.h"

namespace ambilux {

/// Z_0: what next event estimation leaves to hits less what these leave to it. Z_k: of strategy k - 1, its probability
/// less what its picks and the hits of its emitters count. All times the scale of the vertex.
AMBILUX_HD void optimal_variates(const VertexStrategies& v, const EmitterStrategies& all, double* z) {
    const double s = double(v.scale), nee = double(v.next_event.other), hit = double(v.hit.other);
    z[0] = s * (nee - hit);
    for (uint32_t k = 1; k < all.count; ++k) {
        double sum = double(all.probability[k - 1]);
        if (v.next_event_strategy == k - 1) sum -= 1.0 - nee;
        if (v.hit_strategy == k - 1) sum -= hit;
        z[k] = s * sum;
    }
}

/// Of a pixel: number, sums of variates and of light, of products of variates, and of variates and light. Of more than
/// one pixel: the same about the means of each, since these may differ; the number is that of the degrees of freedom.
/// And what tells how much of the variance of the variates was seen: scales squared; for each strategy those of samples
/// that took the rarer side of its pick, and squares of what hits of its emitters count, as next events expect them and
/// as hits have shown them. Variates seem to have no variance before a lamp that is small, or seldom picked, was found
/// in both ways.
struct LeastSquaresSums {
    static constexpr uint32_t kVertices = 0, kLight = 1;
    AMBILUX_HD static constexpr uint32_t variate(uint32_t k) { return 4 + k; }
    AMBILUX_HD static constexpr uint32_t with_light(uint32_t strategies, uint32_t k) { return 4 + strategies + 3 * k; }
    AMBILUX_HD static constexpr uint32_t product(uint32_t strategies, uint32_t i, uint32_t j) {
        return 4 + 4 * strategies + i * (i + 1) / 2 + j;  // j <= i
    }
    enum Seen : uint32_t { kRarePicks, kExpectedHits, kHits, kSeenWords };
    AMBILUX_HD static constexpr uint32_t scale_squared(uint32_t strategies) {
        return product(strategies, strategies, 0);
    }
    AMBILUX_HD static constexpr uint32_t seen(uint32_t strategies, uint32_t k, Seen what) {
        return scale_squared(strategies) + 1 + kSeenWords * k + what;
    }
    AMBILUX_HD static constexpr uint32_t words(uint32_t strategies) { return seen(strategies, strategies, kRarePicks); }

    AMBILUX_HD static void add_sample(const VertexStrategies& v, const EmitterStrategies& all, double* sums) {
        double z[EmitterStrategies::kMost];
        optimal_variates(v, all, z);
        sums[kVertices] += 1.0;
        const Rgb light = v.next_event.weighted + v.hit.weighted;
        for (int c = 0; c < 3; ++c) sums[kLight + c] += double(light[c]);
        for (uint32_t k = 0; k < all.count; ++k) {
            sums[variate(k)] += z[k];
            for (int c = 0; c < 3; ++c) sums[with_light(all.count, k) + c] += z[k] * double(light[c]);
            for (uint32_t j = 0; j <= k; ++j) sums[product(all.count, k, j)] += z[k] * z[j];
        }
        const double nee = double(v.next_event.other), hit = double(v.hit.other), s = double(v.scale) * double(v.scale);
        sums[scale_squared(all.count)] += s;
        for (uint32_t k = 0; k < all.count; ++k)
            if ((k == v.next_event_strategy) == (all.probability[k] < 0.5f)) sums[seen(all.count, k, kRarePicks)] += s;
        // Both have the integral of the density of hits times the squared weight of next events.
        sums[seen(all.count, v.next_event_strategy, kExpectedHits)] += s * nee * (1.0 - nee);
        sums[seen(all.count, v.hit_strategy, kHits)] += s * hit * hit;
    }
    AMBILUX_HD static void add_pixel(double* sums, const double* pixel, uint32_t strategies) {
        const double n = pixel[kVertices];
        if (!(n > 1.0)) return;
        sums[kVertices] += n - 1.0;
        for (uint32_t k = 0; k < strategies; ++k) {
            const double mean = pixel[variate(k)] / n;
            for (uint32_t c = 0; c < 3; ++c)
                sums[with_light(strategies, k) + c] += pixel[with_light(strategies, k) + c] - mean * pixel[kLight + c];
            for (uint32_t j = 0; j <= k; ++j)
                sums[product(strategies, k, j)] += pixel[product(strategies, k, j)] - mean * pixel[variate(j)];
        }
        for (uint32_t k = scale_squared(strategies); k < words(strategies); ++k) sums[k] += pixel[k];
    }
    /// To a block as much as some vertices near it have told, in the mean.
    AMBILUX_HD static void add_from_near(double* sums, const double* near, uint32_t strategies) {
        constexpr double kFromNear = 8.0;
        if (!(near[kVertices] > 0.0)) return;
        const double scale = min(1.0, kFromNear / near[kVertices]);
        for (uint32_t k = 0; k < words(strategies); ++k) sums[k] += near[k] * scale;
    }
    /// `advantages`: of each strategy of next event estimation over hits, as DensitySums::solve has them.
    AMBILUX_HD static void solve(const double* sums, const EmitterStrategies& all, Rgb* advantages) {
        // As if so many vertices more, whose variates have nothing to do with each other or with light, had been seen.
        constexpr double kPrior = 4.0, kLeast = 1e-9, kSeenEnough = 0.5;
        constexpr uint32_t kMost = EmitterStrategies::kMost;
        const uint32_t count = all.count;
        const double n = sums[kVertices], ridge = n > 0.0 ? kPrior / n : 0.0;
        // Variance that so few samples lack: picks change the first variate and that of their strategy independently,
        // hits both alike.
        const auto lacking = [](double expected, double shown) {
            return shown < kSeenEnough * expected ? expected - shown : 0.0;
        };
        double picks[kMost], hits[kMost], all_lacking = 0.0;
        for (uint32_t k = 0; k < count; ++k) {
            const double p = double(all.probability[k]), rare = min(p, 1.0 - p);
            picks[k] = lacking(rare * sums[scale_squared(count)], sums[seen(count, k, kRarePicks)]);
            hits[k] = lacking(sums[seen(count, k, kExpectedHits)], sums[seen(count, k, kHits)]);
            all_lacking += picks[k] + hits[k];
        }
        const auto moment = [&](uint32_t i, uint32_t j) {
            double lacks = i == 0 ? all_lacking : 0.0;
            if (i > 0 && (j == 0 || j == i)) lacks = hits[i - 1] + (j == i ? picks[i - 1] : 0.0);
            return sums[product(count, i, j)] + lacks;
        };
        double root[kMost][kMost] = {}, solution[kMost][3] = {};  // Cholesky; a variate without variance is left out
        for (uint32_t i = 0; i < count; ++i) {
            for (uint32_t j = 0; j <= i; ++j) {
                double rest = moment(i, j) * (i == j ? 1.0 + ridge : 1.0);
                for (uint32_t k = 0; k < j; ++k) rest -= root[i][k] * root[j][k];
                if (i > j)
                    root[i][j] = root[j][j] > 0.0 ? rest / root[j][j] : 0.0;
                else
                    root[i][i] = rest > kLeast * moment(i, i) ? sqrt(rest) : 0.0;
            }
            for (uint32_t c = 0; c < 3; ++c) {
                double rest = -sums[with_light(count, i) + c];
                for (uint32_t k = 0; k < i; ++k) rest -= root[i][k] * solution[k][c];
                solution[i][c] = root[i][i] > 0.0 ? rest / root[i][i] : 0.0;
            }
        }
        for (uint32_t i = count; i-- > 0;)
            for (uint32_t c = 0; c < 3; ++c) {
                double rest = solution[i][c];
                for (uint32_t k = i + 1; k < count; ++k) rest -= root[k][i] * solution[k][c];
                solution[i][c] = root[i][i] > 0.0 ? rest / root[i][i] : 0.0;
            }
        for (uint32_t k = 0; k < count; ++k)
            for (int c = 0; c < 3; ++c)
                advantages[k][c] = float(solution[0][c] + (k + 1 < count ? solution[k + 1][c] : 0.0));
    }
};

}  // namespace ambilux
