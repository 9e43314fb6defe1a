#include "stress/judge.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/distributions.h"

namespace ambilux::stress {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

Mean mean_of(const std::vector<double>& values) {
    const double n = double(values.size());
    double sum = 0, squares = 0;
    for (const double v : values) sum += v;
    for (const double v : values) squares += (v - sum / n) * (v - sum / n);
    return {sum / n, std::sqrt(squares / (n * (n - 1))), n - 1};
}

/// Of every batch, of one box, or of all (box < 0).
std::vector<double> batch_means(const Batches& b, int box) {
    const uint32_t boxes = b.box_count();
    std::vector<double> means(b.boxes.size() / boxes, 0.0);
    for (size_t i = 0; i < means.size(); ++i) {
        if (box >= 0) {
            means[i] = b.boxes[i * boxes + size_t(box)];
            continue;
        }
        for (uint32_t k = 0; k < boxes; ++k) means[i] += b.boxes[i * boxes + k] / boxes;
    }
    return means;
}

/// Sums of powers of deviations of batches from the mean of their box.
struct Powers {
    double squares = 0, cubes = 0;

    void add(const std::vector<double>& means) {
        const double m = mean_of(means).value;
        for (const double v : means) {
            squares += (v - m) * (v - m);
            cubes += (v - m) * (v - m) * (v - m);
        }
    }
    /// Of the mean of all that was added.
    double skewness() const { return squares > 0 ? cubes / std::pow(squares, 1.5) : 0; }
};

/// Whether the mean has an error beyond that of rounding.
bool rests_on_chance(const Mean& mean, double relative_rounding) {
    return mean.error > relative_rounding * std::abs(mean.value);
}

/// N equal rare hits have a relative error of 1/sqrt(N) and a skewness of as much.
double events_of(const Mean& mean, double relative_rounding, double skew) {
    if (!rests_on_chance(mean, relative_rounding)) return mean.value != 0 ? kInf : 0;
    return std::min(std::pow(mean.value / mean.error, 2), skew != 0 ? 1 / (skew * skew) : kInf);
}

/// Normal equivalent of mean - answer, less what `bias` allows. `skew`: skewness of the mean.
double z_of(const Mean& mean, const Mean& answer, double relative_rounding, double skew, double bias) {
    const double whole = mean.value - answer.value;
    const double difference = std::copysign(std::max(std::abs(whole) - bias * std::abs(answer.value), 0.0), whole);
    if (!std::isfinite(difference)) return kInf;
    const double rounding = relative_rounding * std::max(std::abs(mean.value), std::abs(answer.value));
    if (std::abs(difference) <= rounding) return 0;
    const double variance = mean.error * mean.error + answer.error * answer.error;
    if (variance == 0) return std::copysign(kInf, difference);
    double t = std::abs(difference) / std::sqrt(variance + rounding * rounding);
    // A mean that has missed rare bright samples is dark and takes its error for small.
    const double g = (difference < 0 ? 1 : -1) * skew;
    if (g > 0) t = std::max(0.0, std::min(t, t - g * t * t / 3 + g * g * t * t * t / 27 - g / 6));
    const double dof_terms = (mean.dof > 0 ? std::pow(mean.error, 4) / mean.dof : 0) +
                             (answer.dof > 0 ? std::pow(answer.error, 4) / answer.dof : 0);
    const double dof = dof_terms > 0 ? variance * variance / dof_terms : kInf;
    const double z = std::isfinite(dof) ? std::min(t, normal_tail_inverse(student_tail(t, dof))) : t;
    return std::copysign(z, difference);
}

}  // namespace

Mean mean_of(const Batches& batches) { return mean_of(batch_means(batches, -1)); }

double relative_variance(const Mean& mean, double paths) {
    return mean.value != 0 ? mean.error * mean.error * paths / (mean.value * mean.value) : 0;
}

Comparison compare(const Batches& batches, const Mean& answer, bool uniform, double rounding, double bias) {
    Comparison c;
    const Mean mean = mean_of(batches);
    Powers all;
    for (uint32_t k = 0; k < batches.box_count(); ++k) all.add(batch_means(batches, int(k)));
    c.z = z_of(mean, answer, rounding, all.skewness(), bias);
    c.events = events_of(mean, rounding, all.skewness());
    c.bias = answer.value != 0 ? mean.value / answer.value - 1 : 0;
    double p = 2 * normal_tail(std::abs(c.z));
    if (uniform && batches.box_count() > 1) {
        for (uint32_t k = 0; k < batches.box_count(); ++k) {
            const std::vector<double> means = batch_means(batches, int(k));
            const Mean box = mean_of(means);
            Powers own;
            own.add(means);
            // Boxes that may have missed rare bright samples are left to the mean of all.
            if (events_of(box, rounding, own.skewness()) < kFewEvents) continue;
            if (rests_on_chance(mean, rounding) && !rests_on_chance(box, rounding)) continue;
            const double z = z_of(box, answer, rounding, own.skewness(), bias);
            if (std::abs(z) > std::abs(c.box_z)) c.box_z = z;
        }
        p = 2 * std::min(p, sidak(2 * normal_tail(std::abs(c.box_z)), batches.box_count()));
    }
    c.p = std::min(1.0, p);
    return c;
}

std::string verdict_name(Verdict verdict) {
    switch (verdict) {
        case Verdict::ok: return "ok";
        case Verdict::failed: return "failed";
        case Verdict::limit: return "limit";
        case Verdict::noisy: return "noisy";
        case Verdict::invalid: return "invalid";
        case Verdict::refused: return "refused";
        case Verdict::left_out: return "left out";
    }
    return "";
}

Verdict judge(const RowState& row, double rows) {
    const Comparison& c = row.comparison;
    const auto unless_limit = [&](Verdict v) { return row.has_limit ? Verdict::limit : v; };
    if (row.mean == 0 && c.z != 0) return row.rare ? Verdict::noisy : unless_limit(Verdict::failed);
    const bool differs = sidak(c.p, rows) < kSignificance;
    if (c.events >= kFewEvents) {
        if (differs) return unless_limit(Verdict::failed);
    } else if (c.z != 0 && (differs || !(std::abs(c.bias) <= kNear))) {
        return row.rare ? Verdict::noisy : unless_limit(Verdict::noisy);
    }
    if (row.dropped > 0) return unless_limit(Verdict::invalid);
    return Verdict::ok;
}

}  // namespace ambilux::stress
