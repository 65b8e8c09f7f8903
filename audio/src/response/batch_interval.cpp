// The interval of a figure that is computed from all batches of rays, by its values without one of them at a time.
#include "batch_interval.h"

#include <algorithm>
#include <cmath>

#include <rtsg/audio/room_metrics.h>

namespace rtsg {
namespace {

/// Degrees of freedom of the variance of `values`: n - 1 for n values from a normal distribution, fewer if some are far
/// from the others. They follow from the variance of the variance, 2 / (n - 1) and the kurtosis over n (Satterthwaite
/// 1946; O'Neill 2014, "Some useful moment results in sampling problems").
double varianceFreedom(std::span<const double> values) {
    const auto n = static_cast<double>(values.size());
    double mean = 0, squares = 0, fourths = 0;
    for (const double value : values) mean += value / n;
    for (const double value : values) {
        const double square = (value - mean) * (value - mean);
        squares += square;
        fourths += square * square;
    }
    if (n < 4 || !(squares > 0)) return n - 1;
    const double excess = n * fourths / (squares * squares) - 3;
    const double unbiased = (n - 1) / ((n - 2) * (n - 3)) * ((n + 1) * excess + 6);
    return 2 / (2 / (n - 1) + std::max(0.0, unbiased) / n);
}

}  // namespace

double halfWidth95(std::span<const double> without, double whole) {
    const auto n = static_cast<double>(without.size());
    double mean = 0, squares = 0, cubes = 0;
    for (const double value : without) mean += value / n;
    for (const double value : without) {
        const double square = (value - mean) * (value - mean);
        squares += square;
        cubes += square * (value - mean);
    }
    const double bias = (n - 1) * (mean - whole), error = std::sqrt(squares * (n - 1) / n);
    const double t = studentT95(varianceFreedom(without));
    // Johnson 1978, "Modified t tests and confidence intervals for asymmetrical populations": the interval is shifted
    // towards the long tail. Skewness counts only beyond what any n values would show by chance.
    const double skewness = squares > 0 ? std::abs(cubes) / n / std::pow(squares / n, 1.5) : 0;
    const double farther = std::max(0.0, skewness - std::sqrt(6 / n)) * (1 + 2 * t * t) / (6 * std::sqrt(n));
    return t * std::hypot(error, bias) + farther * error;
}

}  // namespace rtsg
