// Fits two exponentials to a decay curve.
#include "decay_slopes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace rtsg {
namespace {

/// Logarithms of both shares of the energy at the start and of both rates, 1/s; the slower one last.
using Parameters = std::array<double, 4>;
using DecayPoint = std::pair<double, double>;  // seconds, dB

double model(const Parameters& p, double seconds) {
    return 10 * std::log10(std::exp(p[0] - std::exp(p[2]) * seconds) + std::exp(p[1] - std::exp(p[3]) * seconds));
}

double misfit(const Parameters& p, std::span<const DecayPoint> positions) {
    double sum = 0;
    for (const auto& [seconds, level] : positions) sum += std::pow(model(p, seconds) - level, 2);
    return sum;
}

/// dB and dB/s of the line through the places between two levels.
std::pair<double, double> lineThrough(std::span<const DecayPoint> positions, double fromDb, double toDb) {
    double n = 0, t = 0, l = 0, tt = 0, tl = 0;
    for (const auto& [seconds, level] : positions)
        if (level <= fromDb && level >= toDb)
            n += 1, t += seconds, l += level, tt += seconds * seconds, tl += seconds * level;
    const double slope = (n * tl - t * l) / (n * tt - t * t);
    return {(l - slope * t) / n, slope};
}

/// Solves a x = b by elimination; `a` has a diagonal that is not small.
Parameters solved(std::array<Parameters, 4> a, Parameters b) {
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t row = i + 1; row < 4; ++row) {
            const double factor = a[row][i] / a[i][i];
            for (std::size_t k = i; k < 4; ++k) a[row][k] -= factor * a[i][k];
            b[row] -= factor * b[i];
        }
    for (std::size_t i = 4; i-- > 0;) {
        for (std::size_t k = i + 1; k < 4; ++k) b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    return b;
}

/// One step from `p`; `damping` tells how far it trusts that the model is straight.
Parameters stepped(const Parameters& p, std::span<const DecayPoint> positions, double damping) {
    std::array<Parameters, 4> normal{};
    Parameters right{};
    for (const auto& [seconds, level] : positions) {
        const double first = std::exp(p[0] - std::exp(p[2]) * seconds),
                     second = std::exp(p[1] - std::exp(p[3]) * seconds);
        const double perPart = 10 / std::log(10.0) / (first + second);
        const Parameters slope{perPart * first, perPart * second, -perPart * first * std::exp(p[2]) * seconds,
                               -perPart * second * std::exp(p[3]) * seconds};
        const double off = level - model(p, seconds);
        for (std::size_t i = 0; i < 4; ++i) {
            right[i] += slope[i] * off;
            for (std::size_t k = 0; k < 4; ++k) normal[i][k] += slope[i] * slope[k];
        }
    }
    for (std::size_t i = 0; i < 4; ++i) normal[i][i] += damping * normal[i][i] + 1e-12;
    Parameters next = solved(normal, right);
    for (std::size_t i = 0; i < 4; ++i) next[i] += p[i];
    return next;
}

}  // namespace

DecaySlopes fitSlopes(std::span<const double> levelDb, double gridSeconds) {
    constexpr double kFrom = -5, kTo = -50, kMin = -45;
    constexpr int kRounds = 200;
    constexpr double kApart = 1.1;                      // slopes that are nearer than this are one
    const double rateOfSlope = -std::log(10.0) / 10.0;  // 1/s of dB/s
    if (levelDb.empty() || levelDb.back() > kMin) return {};
    std::vector<DecayPoint> positions;
    for (std::size_t k = 0; k < levelDb.size(); ++k)
        if (levelDb[k] <= kFrom && levelDb[k] >= kTo)
            positions.emplace_back(static_cast<double>(k) * gridSeconds, levelDb[k]);
    if (positions.size() < 8) return {};
    const auto [lateDb, lateSlope] = lineThrough(positions, -35, kTo);
    const auto [earlyDb, earlySlope] = lineThrough(positions, kFrom, -15);
    if (!(lateSlope < 0) || !(earlySlope < lateSlope)) return {};
    const double late = std::min(0.9, std::pow(10.0, lateDb / 10));
    Parameters p{std::log(1 - late), std::log(late), std::log(rateOfSlope * earlySlope),
                 std::log(rateOfSlope * lateSlope)};
    double now = misfit(p, positions), damping = 1e-3;
    for (int round = 0; round < kRounds && damping < 1e9; ++round) {
        const Parameters next = stepped(p, positions, damping);
        const double then = misfit(next, positions);
        damping *= then < now ? 0.3 : 4;
        if (then < now) p = next, now = then;
    }
    constexpr double kDecay60 = 13.815510557964274;  // ln 10^6
    const DecaySlopes slopes{kDecay60 / std::exp(p[2]), kDecay60 / std::exp(p[3])};
    const bool found = std::isfinite(now) && slopes.late > kApart * slopes.early;
    return found ? slopes : DecaySlopes();
}

}  // namespace rtsg
