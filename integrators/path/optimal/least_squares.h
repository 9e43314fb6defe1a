// The same weights by least squares. With weights of the balance heuristic, a sample Y of a vertex and variates Z_k
// of mean zero, Y + Σ a_k Z_k has the least variance where the a_k are minus the regression of Y on Z. In the limit
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
/// Beside them, variance of the variates that was not seen so far: they seem to have none before a lamp that is small,
/// or seldom picked, was found in both ways.
struct LeastSquaresSums {
    static constexpr uint32_t kVertices = 0, kLight = 1;
    AMBILUX_HD static constexpr uint32_t variate(uint32_t k) { return 4 + k; }
    AMBILUX_HD static constexpr uint32_t with_light(uint32_t strategies, uint32_t k) { return 4 + strategies + 3 * k; }
    AMBILUX_HD static constexpr uint32_t product(uint32_t strategies, uint32_t i, uint32_t j) {
        return 4 + 4 * strategies + i * (i + 1) / 2 + j;  // j <= i
    }
    AMBILUX_HD static constexpr uint32_t words(uint32_t strategies) { return product(strategies, strategies, 0); }
    /// Of hits of the emitters of each strategy; where there are several, of their picks, and scales squared.
    AMBILUX_HD static constexpr uint32_t lack_words(uint32_t strategies) {
        return strategies > 1 ? 2 * strategies + 1 : 1;
    }

    AMBILUX_HD static void add_sample(const VertexStrategies& v, const EmitterStrategies& all, double* sums,
                                      float* lacks) {
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
        // What is expected less what is shown. Both squares have the integral of the density of hits times the squared
        // weight of next events; the rarer side of a pick is taken with a known probability.
        lacks[v.next_event_strategy] += float(s * nee * (1.0 - nee));
        lacks[v.hit_strategy] -= float(s * hit * hit);
        if (all.count == 1) return;
        for (uint32_t k = 0; k < all.count; ++k) {
            const bool is_rare = (k == v.next_event_strategy) == (all.probability[k] < 0.5f);
            lacks[all.count + k] += float(s * (rare_pick(all, k) - (is_rare ? 1.0 : 0.0)));
        }
        lacks[2 * all.count] += float(s);
    }
    AMBILUX_HD static void add_pixel(double* sums, const double* pixel, const float* lacks, uint32_t strategies) {
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
        for (uint32_t k = 0; k < lack_words(strategies); ++k) sums[words(strategies) + k] += double(lacks[k]);
    }
    /// To a block as much as some vertices near it have told, in the mean.
    AMBILUX_HD static void add_from_near(double* sums, const double* near, uint32_t strategies) {
        constexpr double kFromNear = 8.0;
        if (!(near[kVertices] > 0.0)) return;
        const double scale = min(1.0, kFromNear / near[kVertices]);
        for (uint32_t k = 0; k < words(strategies) + lack_words(strategies); ++k) sums[k] += near[k] * scale;
    }
    /// `advantages`: of each strategy of next event estimation over hits, as DensitySums::solve has them.
    AMBILUX_HD static void solve(const double* sums, const EmitterStrategies& all, Rgb* advantages) {
        // As if so many vertices more, whose variates have nothing to do with each other or with light, had been seen.
        constexpr double kPrior = 4.0, kLeast = 1e-9;
        constexpr uint32_t kMost = EmitterStrategies::kMost;
        const uint32_t count = all.count;
        const double n = sums[kVertices], ridge = n > 0.0 ? kPrior / n : 0.0;
        // Variance that is lacking, where less than half was seen: picks change the first variate and that of their
        // strategy independently, hits both alike.
        const double* lacks = sums + words(count);
        const auto where_more = [](double lack, double than) { return lack > than ? lack : 0.0; };
        double picks[kMost], hits[kMost], all_lacking = 0.0;
        for (uint32_t k = 0; k < count; ++k) {
            const uint32_t own = k + 1 < count ? k + 1 : 0;
            hits[k] = where_more(lacks[k], sums[product(count, own, own)]);
            picks[k] = count > 1 ? where_more(lacks[count + k], 0.5 * rare_pick(all, k) * lacks[2 * count]) : 0.0;
            all_lacking += picks[k] + hits[k];
        }
        const auto moment = [&](uint32_t i, uint32_t j) {
            double lacking = i == 0 ? all_lacking : 0.0;
            if (i > 0 && (j == 0 || j == i)) lacking = hits[i - 1] + (j == i ? picks[i - 1] : 0.0);
            return sums[product(count, i, j)] + lacking;
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

private:
    /// Probability of the rarer side of a pick.
    AMBILUX_HD static double rare_pick(const EmitterStrategies& all, uint32_t k) {
        return min(double(all.probability[k]), 1.0 - double(all.probability[k]));
    }
};

}  // namespace ambilux
