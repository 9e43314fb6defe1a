// Whether a measured mean can be the answer.
#pragma once

#include <string>

#include "stress/measure.h"

namespace ambilux::stress {

/// A mean as a random variable.
struct Mean {
    double value = 0, error = 0;  ///< error: standard error; 0 of a closed form
    double dof = 0;               ///< degrees of freedom of the error; 0 of a closed form
};

/// Of all boxes together.
Mean mean_of(const Batches& batches);

/// Relative variance of the mean of one sample of every pixel, times their number.
double relative_variance(const Mean& mean, double paths);

struct Comparison {
    double z = 0;       ///< normal equivalent of the difference of the means, after skewness is taken out
    double box_z = 0;   ///< of the box that is furthest off; 0 where boxes are not compared
    double p = 1;       ///< two-sided, of both together: Sidak over the boxes, Bonferroni over the two tests
    double events = 0;  ///< rough number of random events that the mean rests on
    double bias = 0;    ///< relative difference of the means
};

/// A mean of fewer events than this may have missed rare bright samples, and then its error is too small as well. It is
/// right if it lies near the answer, and else says nothing.
constexpr double kFewEvents = 16, kNear = 0.03;

/// `uniform`: every box has the same answer. `rounding`: as of Answer. `bias`: share of the answer by which a mean may
/// be off (Stressed::bias); what is more than that is judged. Student's t with the degrees of freedom of Welch and
/// Satterthwaite; skewness by Hall's transformation, where it makes |t| smaller (film/ztest.h).
Comparison compare(const Batches& batches, const Mean& answer, bool uniform, double rounding, double bias = 0);

/// What a row says of a cell.
enum class Verdict {
    ok,
    failed,   ///< another mean, and no limit that is known
    limit,    ///< another mean, invalid values or a refusal where docs/numerics.md says so
    noisy,    ///< too few events to say anything
    invalid,  ///< the mean may be right, but values were dropped or lost, and counted
    refused,  ///< the program says that it cannot render this
    left_out  ///< not rendered: the method cannot find the light, or the cell is for devices
};
std::string verdict_name(Verdict verdict);

/// Chance that one of all rows fails though each is right: that of five standard deviations.
constexpr double kSignificance = 5.7330e-7;

struct RowState {
    Comparison comparison;
    double mean = 0;
    bool rare = false;  ///< the method finds the light too rarely (Cell::rare)
    bool has_limit = false;
    uint64_t dropped = 0;  ///< invalid and lost values
};
/// `rows`: of the whole sweep, for the correction.
Verdict judge(const RowState& row, double rows);

}  // namespace ambilux::stress
