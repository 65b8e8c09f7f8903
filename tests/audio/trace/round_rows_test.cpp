// Sound round two round bodies in a row, beside exact series and boundary elements.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "rigid_outline.h"
#include "rigid_round.h"
#include "round_levels.h"
#include "round_shapes.h"
#include "walled.h"

namespace rtsg {
namespace {

using namespace test;

using Drawn = RigidOutline::Closed;

Drawn circle(const glm::dvec2& center, double radius, int sides) {
    Drawn result;
    for (int i = 0; i < sides; ++i) result.push_back(center + glm::dvec2(about(radius, 360.0 * i / sides, 0)));
    return result;
}
/// 120 m high, so that their ends are far off.
Walled standing(const std::vector<Drawn>& outlines, double half = 60) {
    RoundMesh all;
    for (const Drawn& one : outlines) {
        const auto n = static_cast<std::uint32_t>(one.size()), at = static_cast<std::uint32_t>(all.corners.size());
        for (const double z : {-half, half})
            for (const glm::dvec2& p : one) all.corners.emplace_back(p, z);
        for (std::uint32_t i = 0; i < n; ++i) all.addQuad(at + i, at + (i + 1) % n, at + n + (i + 1) % n, at + n + i);
    }
    return all.walled();
}

glm::dvec2 positionOf(const BesideTwo::SurfacePoint& position) {
    return {position.x, position.y};
}
Walled columns(const BesideTwo& at, int sides) {
    return standing(
        {circle(positionOf(at.centers[0]), at.radii[0], sides), circle(positionOf(at.centers[1]), at.radii[1], sides)});
}
TraceResult tracedBehind(const Walled& walls, const glm::dvec2& source, const glm::dvec2& listener) {
    return walls.traced({source, 0}, {listener, 0});
}

TEST(RoundRows, TonesBehindTwoColumnsAreThoseOfTheSeries) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform(0, 1);
    Errors errors;
    for (int i = 0; i < 8; ++i) {
        BesideTwo at{{}, {.15 * std::pow(4, uniform(random)), .15 * std::pow(4, uniform(random))}, {}, {}};
        at.centers[1].x = at.radii[0] + at.radii[1] + .3 * std::pow(5, uniform(random));
        at.source = {-at.radii[0] - .5 * std::pow(5, uniform(random)), 1.4 * uniform(random) - .7};
        at.listener = {at.centers[1].x + at.radii[1] + .5 * std::pow(5, uniform(random)), 1.4 * uniform(random) - .7};
        const TraceResult traced = tracedBehind(columns(at, 48), positionOf(at.source), positionOf(at.listener));
        const double distance = at.source.to(at.listener);
        for (const std::size_t tone : {9u, 14u, 19u, 24u}) {
            const double k = 2 * M_PI * edgeToneHz(static_cast<double>(tone)) / 343;
            errors.add(decibelsOf(traced, tone, distance) - decibelsOf(besideTwoCylinders(at, k), distance));
        }
    }
    EXPECT_LT(errors.rms(), 2);
    EXPECT_LT(errors.worst, 4.2);
}

/// For places on a line, the errors relative to boundary elements with a line source. Where waves cancel, `deepest` dB
/// below the mean along the line, errors are left out.
Errors errorsBehind(const std::vector<Drawn>& outlines, const std::vector<glm::dvec2>& inside, const glm::dvec2& source,
                    const glm::dvec2& from, const glm::dvec2& to, const std::vector<std::size_t>& tones = {13, 18, 23},
                    double deepest = 1e3) {
    const Walled walls = standing(outlines);
    Errors errors;
    for (const std::size_t tone : tones) {
        const double k = 2 * M_PI * edgeToneHz(static_cast<double>(tone)) / 343;
        const RigidOutline exact(outlines, inside, k, std::min(.15, .8 / k));
        constexpr int kPositions = 9;
        std::vector<glm::dvec2> listeners;
        std::vector<double> energies;
        double mean = 0;
        for (int i = 0; i < kPositions; ++i) {
            listeners.push_back(from + (to - from) * (i / (kPositions - 1.0)));
            energies.push_back(std::norm(exact.beside(source, listeners.back())));
            mean += energies.back() / kPositions;
        }
        for (std::size_t i = 0; i < listeners.size(); ++i) {
            const double level = 10 * std::log10(energies[i]), distance = glm::distance(source, listeners[i]);
            if (level > 10 * std::log10(mean) - deepest)
                errors.add(decibelsOf(tracedBehind(walls, source, listeners[i]), tone, distance, true) - level);
        }
    }
    return errors;
}

TEST(RoundRows, RoundOneColumnTheyAgreeWithBoundaryElements) {
    const Errors errors =
        errorsBehind({circle({0, 0}, .3, 48)}, {{.03, .02}, {-.1, .05}, {.05, -.12}}, {-1.5, .1}, {2, -1}, {2, 1});
    EXPECT_LT(errors.worst, 1.2);
}

TEST(RoundRows, RoundBothCornersOfAWallSoundComesAsThere) {
    Drawn wall{{-.6, -8}, {.6, -8}};
    for (int i = 0; i <= 10; ++i) wall.emplace_back(glm::dvec2(.3, -.3) + glm::dvec2(about(.3, 9 * i, 0)));
    for (int i = 0; i <= 10; ++i) wall.emplace_back(glm::dvec2(-.3, -.3) + glm::dvec2(about(.3, 90 + 9 * i, 0)));
    const Errors errors = errorsBehind({wall}, {{.03, -.62}, {-.1, -1.5}, {.05, -3.2}, {.04, -5.3}, {-.15, -7}},
                                       {-2, -1}, {2, -.9}, {2, 1.1});
    EXPECT_LT(errors.rms(), 1.2);
    EXPECT_LT(errors.worst, 2.4);
}

/// Levels of tones and of octaves on a way, each beside the one before.
void expectSmooth(const Walled& walls, const glm::dvec2& source, const glm::dvec2& from, const glm::dvec2& to,
                  double maximum) {
    const int steps = static_cast<int>(std::ceil(glm::distance(from, to) / .02));
    std::vector<double> before;
    for (int i = 0; i <= steps; ++i) {
        const glm::dvec2 listener = from + (to - from) * (static_cast<double>(i) / steps);
        const TraceResult traced = tracedBehind(walls, source, listener);
        const Bands octaves = total(traced.arrivals);
        std::vector<double> levels;
        for (std::size_t band = 1; band < 5; ++band) {
            levels.push_back(decibelsOf(traced, 5 * band + 2, 1));
            levels.push_back(10 * std::log10(octaves[band]));
        }
        for (std::size_t k = 0; k < before.size(); ++k)
            EXPECT_NEAR(levels[k], before[k], maximum) << source.y << " at " << listener.y << ", " << k;
        before = levels;
    }
}

TEST(RoundRows, NothingJumpsBehindThem) {
    const Drawn one = circle({0, 0}, .3, 48), other = circle({1.2, 0}, .3, 48);
    expectSmooth(standing({one, other}), {-1.5, .1}, {2.7, -2}, {2.7, 2}, 2.2);
    // Side by side there is no first and no second one.
    expectSmooth(standing({one, circle({.1, 1}, .25, 24)}), {-1.5, .3}, {1.5, -1}, {1.5, 2}, 4);
}

}  // namespace
}  // namespace rtsg
