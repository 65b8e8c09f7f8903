// Sheets of no thickness, seen edge-on and from behind, beside boundary elements of thin bodies.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "rigid_body.h"
#include "walled.h"

namespace rtsg {
namespace {

using namespace test;

constexpr double kTones[] = {63, 125, 250, 500};

Walled squareSheet() {
    return {{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {0, 1, 2, 0, 2, 3}, 0, {WorldFromLocal(1.0)}, false};
}
Walled roundSheet() {
    std::vector<glm::dvec3> corners{{0, 0, 0}};
    std::vector<std::uint32_t> triangles;
    for (int i = 0; i < 48; ++i) corners.emplace_back(std::cos(2 * M_PI * i / 48), std::sin(2 * M_PI * i / 48), 0);
    for (std::uint32_t i = 0; i < 48; ++i) triangles.insert(triangles.end(), {0, 1 + i, 1 + (i + 1) % 48});
    return {corners, triangles, 0, {WorldFromLocal(1.0)}, false};
}
double heardBeside(const Walled& walls, const glm::dvec3& source, const glm::dvec3& listener, double hz) {
    return heardAt(walls.traced(source, listener), hz, glm::distance(source, listener));
}

/// Root mean square and worst of what levels of tones are off, dB.
struct OffBody {
    double square = 0, worst = 0;
};
template <class Position>
OffBody offBody(const Walled& sheet, RigidBody& body, const Position& positions) {
    OffBody off;
    constexpr int kSources = 3, kPositions = 12;
    for (int i = 0; i < kSources; ++i) {
        const glm::dvec3 source = positions(true);
        std::vector<glm::dvec3> listeners;
        for (int k = 0; k < kPositions; ++k) listeners.push_back(positions(false));
        for (const double hz : kTones) {
            body.light(source, 2 * M_PI * hz / 343);
            for (const glm::dvec3& listener : listeners) {
                const double one = heardBeside(sheet, source, listener, hz) - body.level(listener);
                off.square += one * one / (kSources * kPositions * std::size(kTones));
                off.worst = std::max(off.worst, std::abs(one));
            }
        }
    }
    return off;
}

TEST(Sheets, EdgeOnLevelsAreThoseOfTheIntegralOverThem) {
    const unsigned seed = 129;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    const auto positions = [&](bool source) {
        return source ? glm::dvec3(-between(1.5, 3), between(-1, 1), between(-.5, .5))
                      : glm::dvec3(between(1.3, 3), between(-1, 1), between(-.8, .8));
    };
    // Without what goes along them from rim to rim it was 6 and 7 dB, 21 dB at most.
    RigidBox box({-1, -1, -.03}, {1, 1, .03}, 10);
    const OffBody square = offBody(squareSheet(), box, positions);
    EXPECT_LT(std::sqrt(square.square), .8);
    EXPECT_LT(square.worst, 2.8);
    RigidPrism prism(24, .06, 1, 6, 1);
    const OffBody round = offBody(roundSheet(), prism, positions);
    EXPECT_LT(std::sqrt(round.square), .85);
    EXPECT_LT(round.worst, 2.2);
}

TEST(Sheets, BehindThemLevelsAreThoseOfTheIntegral) {
    const unsigned seed = 130;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    RigidBox box({-1, -1, -.03}, {1, 1, .03}, 10);
    const OffBody off = offBody(squareSheet(), box, [&](bool source) {
        return source ? glm::dvec3(between(-1, 1), between(-1, 1), between(1, 3))
                      : glm::dvec3(between(-1.5, 1.5), between(-1.5, 1.5), -between(.3, 3));
    });
    EXPECT_LT(std::sqrt(off.square), 1.2);
    EXPECT_LT(off.worst, 7);
}

TEST(Sheets, InTheirPlaneLevelsAreThoseBesideIt) {
    // By chance both were on either side: up to 10 dB too loud, or nothing at all.
    const Walled sheet = squareSheet();
    for (const double height : {0.0, 1e-6, .2, 1.0}) {
        const glm::dvec3 source(-3, .2, height);
        for (const double hz : {63.0, 500.0, 4000.0}) {
            const double at = heardBeside(sheet, source, {2, -.1, 0}, hz);
            for (const double off : {1e-9, 1e-6, 1e-5, 1e-4})
                for (const double side : {-off, off})
                    EXPECT_NEAR(heardBeside(sheet, source, {2, -.1, side}, hz), at,
                                height < .1   ? .12
                                : height < .5 ? 1.2
                                              : 2.5)
                        << height << ' ' << hz << ' ' << side;
        }
    }
}

TEST(Sheets, TwoInOnePlaneHideNothingThatPassesBetweenThem) {
    // From above the one to below the other, through the gap; and on the same side of both.
    const Walled two(
        {{-2, -1, 0}, {-.5, -1, 0}, {-.5, 1, 0}, {-2, 1, 0}, {.5, -1, 0}, {2, -1, 0}, {2, 1, 0}, {.5, 1, 0}},
        {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7}, 0, {WorldFromLocal(1.0)}, false);
    for (const double tilt : {1e-7, 1e-6, 1e-5, 1e-4})
        for (const double hz : {500.0, 2000.0}) {
            EXPECT_NEAR(heardBeside(two, {-3, .1, 3 * tilt}, {3, -.1, -3 * tilt}, hz), 0, 6) << tilt << ' ' << hz;
            EXPECT_NEAR(heardBeside(two, {-3, .1, 3 * tilt}, {3, -.1, 3 * tilt}, hz), 0, 6) << tilt << ' ' << hz;
        }
}

}  // namespace
}  // namespace rtsg
