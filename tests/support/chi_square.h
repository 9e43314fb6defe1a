// Chi-square tests of directional sampling against its density (shared by the tests of BSDFs, emitters and cameras).
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/distributions.h"
#include "core/math.h"

namespace ambilux::test {

struct ChiSquare {
    double statistic, p_value;
    int degrees;
};

/// Pearson's test of counts against expected counts. Cells that expect fewer than 10 are pooled.
inline ChiSquare chi_square(const std::vector<double>& observed, const std::vector<double>& expected) {
    double statistic = 0, pooled_observed = 0, pooled_expected = 0;
    int cells = 0;
    const auto add = [&](double o, double e) {
        statistic += (o - e) * (o - e) / e;
        ++cells;
    };
    for (size_t i = 0; i < observed.size(); ++i) {
        if (expected[i] >= 10)
            add(observed[i], expected[i]);
        else {
            pooled_observed += observed[i];
            pooled_expected += expected[i];
        }
    }
    // A sample where hardly any was expected must count against the density.
    if (pooled_expected >= 1 || pooled_observed > 0) add(pooled_observed, std::max(pooled_expected, 0.1));
    return {statistic, cells > 1 ? chi_square_tail(statistic, cells - 1) : 1.0, cells - 1};
}

/// Cells over the sphere in coordinates (t, phi) around an axis: the angle theta to the axis is w·sqrt((1+(pi/w)²)^t -
/// 1), so that cells resolve a lobe of angular width w and yet cover the sphere with few cells. An axis near the
/// horizon z = 0 is moved onto it, and the horizon, where densities jump, is then an edge of cells (for an even number
/// of phi_cells).
class LobeGrid {
public:
    LobeGrid(Vec3f axis, double width, int t_cells, int phi_cells)
        : frame_(frame_from_normal(axis)), width_(width), log_(std::log1p(kPiD * kPiD / (width * width))),
          t_cells_(t_cells), phi_cells_(phi_cells) {
        if (std::fabs(axis.z) < std::sin(std::min(3 * width, 1.57))) {
            const double l = std::hypot(double(axis.x), double(axis.y));
            const float c = l > 0 ? float(axis.x / l) : 1.0f, s = l > 0 ? float(axis.y / l) : 0.0f;
            frame_ = {{-s, c, 0}, {0, 0, 1}, {c, s, 0}};
        }
    }

    int size() const { return t_cells_ * phi_cells_; }

    int cell(Vec3f w) const {
        const Vec3f v = frame_.to_local(w);
        // atan2 keeps small angles exact.
        const double theta = std::atan2(std::hypot(double(v.x), double(v.y)), double(v.z));
        double phi = std::atan2(double(v.y), double(v.x)) / (2 * kPiD);
        if (phi < 0) phi += 1;
        const double t = std::log1p(theta * theta / (width_ * width_)) / log_;
        return std::clamp(int(t * t_cells_), 0, t_cells_ - 1) * phi_cells_ +
               std::clamp(int(phi * phi_cells_), 0, phi_cells_ - 1);
    }

    struct Tolerance {
        double relative, absolute;
    };

    /// Integral over cell `index` of a density per solid angle, by adaptive Gauss quadrature that bisects `forced`
    /// times in any case. `tolerance`: of a piece, relative to the cell.
    template <typename Density>
    double integrate(int index, Density density, int forced = 2, Tolerance tolerance = {1e-4, 1e-8}) const {
        const double t0 = double(index / phi_cells_) / t_cells_, p0 = double(index % phi_cells_) / phi_cells_;
        const double t1 = t0 + 1.0 / t_cells_, p1 = p0 + 1.0 / phi_cells_;
        const double whole = gauss(t0, t1, p0, p1, density);
        return refine(t0, t1, p0, p1, whole, forced, forced + 6, density, tolerance, nullptr);
    }

    /// Counts that `samples` draws from the density put into each cell. Where a count in `observed` (from index
    /// `first`) or the sum of all looks unlikely, integrals are repeated with more effort, because quadrature may miss
    /// slivers cut off by a horizon.
    template <typename Density>
    std::vector<double> expected_counts(const std::vector<double>& observed, int first, double samples,
                                        Density density) const {
        std::vector<double> expected(size());
        bool all = true;
        for (int forced = 1; forced <= 6; forced += forced == 1 ? 1 : 2) {
            double sum = 0, observed_sum = 0;
            for (int c = 0; c < size(); ++c) {
                const double o = observed[first + c];
                if (all || std::fabs(o - expected[c]) > 3 * std::sqrt(expected[c]))
                    expected[c] = samples * integrate(c, density, forced, kOfCounts);
                sum += expected[c];
                observed_sum += o;
            }
            const double p = std::min(sum / samples, 1.0);
            all = std::fabs(sum - observed_sum) > 2.5 * std::sqrt(samples * p * (1 - p)) + kQuadrature * samples + 1;
        }
        return expected;
    }

private:
    static constexpr double kPiD = 3.14159265358979323846;
    static constexpr double kQuadrature = 5e-5;  ///< error of all cells together that is no reason for more effort
    static constexpr Tolerance kOfCounts = {5e-4, 1e-7};  ///< far below what chance makes of counts up to a million
    Frame frame_;
    double width_, log_;
    int t_cells_, phi_cells_;

    template <typename Density>
    double gauss(double t0, double t1, double p0, double p1, Density& density) const {
        static const double node[3] = {0.5 - 0.3872983346207417, 0.5, 0.5 + 0.3872983346207417};
        static const double weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
        double cosine_phi[3], sine_phi[3], sum = 0;
        for (int j = 0; j < 3; ++j) {
            const double phi = 2 * kPiD * (p0 + (p1 - p0) * node[j]);
            cosine_phi[j] = std::cos(phi);
            sine_phi[j] = std::sin(phi);
        }
        for (int i = 0; i < 3; ++i) {
            const double growth = std::exp(log_ * (t0 + (t1 - t0) * node[i]));
            const double theta = width_ * std::sqrt(growth - 1), sine = std::sin(theta);
            const double jacobian = sine / theta * 0.5 * width_ * width_ * log_ * growth;
            const float z = float(std::cos(theta));
            for (int j = 0; j < 3; ++j) {
                const Vec3f v = {float(sine * cosine_phi[j]), float(sine * sine_phi[j]), z};
                sum += weight[i] * weight[j] * jacobian * double(density(normalize(frame_.to_world(v))));
            }
        }
        return sum * 2 * kPiD * (t1 - t0) * (p1 - p0);
    }

    template <typename Density>
    double refine(double t0, double t1, double p0, double p1, double whole, int forced, int depth, Density& density,
                  Tolerance tolerance, const double* of_cell) const {
        const double tm = 0.5 * (t0 + t1), pm = 0.5 * (p0 + p1);
        const double part[4] = {gauss(t0, tm, p0, pm, density), gauss(tm, t1, p0, pm, density),
                                gauss(t0, tm, pm, p1, density), gauss(tm, t1, pm, p1, density)};
        const double sum = part[0] + part[1] + part[2] + part[3];
        // Fixed by the first estimate: an absolute error per piece.
        const double allowed = of_cell ? *of_cell : tolerance.relative * sum + tolerance.absolute;
        if (depth == 0 || (forced <= 0 && std::fabs(sum - whole) <= allowed)) return sum;
        const auto piece = [&](double a, double b, double c, double d, double estimate) {
            return refine(a, b, c, d, estimate, forced - 1, depth - 1, density, tolerance, &allowed);
        };
        return piece(t0, tm, p0, pm, part[0]) + piece(tm, t1, p0, pm, part[1]) + piece(t0, tm, pm, p1, part[2]) +
               piece(tm, t1, pm, p1, part[3]);
    }
};

/// Two-sided chance that a normal variable lies |z| or more from its mean.
inline double normal_two_sided(double z) { return 2 * normal_tail(std::fabs(z)); }

}  // namespace ambilux::test
