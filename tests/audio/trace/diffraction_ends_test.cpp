// Edges that end, against the integral of Biot, Tolstoy and Medwin over them, and where the shortest way leads past.
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <random>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "edges/diffraction_ends.h"
#include "edges/diffraction_hidden_parts.h"
#include "edges/diffraction_paths.h"
#include "walled.h"

namespace rtsg {
namespace {

using namespace test;
using EdgePressure = std::complex<double>;

/// The integral along the edge, from `from` to `to` metres on from the place of the shortest way; plain trapezoids,
/// finer near to that. Parts with the difference of the angles, and with their sum.
std::array<EdgePressure, 2> alongEdge(const WedgePath& path, double waveNumber, double from, double to) {
    const double nu = M_PI / path.opening, rs = path.sourceRadius, rr = path.receiverRadius;
    const double shortest = path.along * rs / (rs + rr);
    constexpr double kFine = 1e-4;
    constexpr int kSteps = 60'000;
    const double begin = std::asinh(from / kFine), end = std::asinh(to / kFine);
    std::array<EdgePressure, 2> sum{};
    for (int i = 0; i < kSteps; ++i) {
        const double u = begin + (end - begin) * (i + .5) / kSteps;
        const double in = shortest + kFine * std::sinh(u), out = path.along - in;
        const double m = std::hypot(rs, in), l = std::hypot(rr, out);
        const double eta = std::acosh(std::max(1.0, (m * l - in * out) / (rs * rr)));
        const EdgePressure here =
            std::polar(-nu / (4 * M_PI * m * l) * kFine * std::cosh(u) * (end - begin) / kSteps, -waveNumber * (m + l));
        const double difference = path.receiverAngle - path.sourceAngle, both = path.receiverAngle + path.sourceAngle;
        for (const double sign : {1.0, -1.0}) {
            const auto part = [&](double angle) {
                return std::sin(nu * (M_PI + sign * angle)) /
                       (std::cosh(nu * eta) - std::cos(nu * (M_PI + sign * angle)));
            };
            sum[0] += here * part(difference);
            sum[1] += here * part(both);
        }
    }
    return sum;
}

/// A screen in the plane z = 0 that stands free: x from -2 to 2 m, y from 0 to 2 m, its rims in so many pieces each,
/// that are `uneven` metres off a straight line.
Walled screen(int pieces = 1, double uneven = 0) {
    std::vector<glm::dvec3> corners;
    std::vector<std::uint32_t> triangles;
    const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * (pieces + 1) + j); };
    for (int i = 0; i <= pieces; ++i)
        for (int j = 0; j <= pieces; ++j)
            corners.emplace_back(-2 + 4.0 * i / pieces + uneven * (j % 2), 2.0 * j / pieces + uneven * (i % 2), 0);
    for (int i = 0; i < pieces; ++i)
        for (int j = 0; j < pieces; ++j)
            for (const std::uint32_t corner :
                 {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)})
                triangles.push_back(corner);
    return {corners, triangles};
}

/// By all four rims, exactly, and straight where nothing hides it; dB re the source in the open.
double behindScreen(const glm::dvec3& source, const glm::dvec3& listener, double hz) {
    struct Rim {
        glm::dvec3 from, to, inward;
    };
    const Rim rims[] = {{{-2, 0, 0}, {2, 0, 0}, {0, 1, 0}},
                        {{-2, 2, 0}, {2, 2, 0}, {0, -1, 0}},
                        {{-2, 0, 0}, {-2, 2, 0}, {1, 0, 0}},
                        {{2, 0, 0}, {2, 2, 0}, {-1, 0, 0}}};
    const double k = 2 * M_PI * hz / 343, distance = glm::distance(source, listener);
    const glm::dvec3 through = source + (listener - source) * (source.z / (source.z - listener.z));
    const bool hidden = std::abs(through.x) < 2 && through.y > 0 && through.y < 2;
    EdgePressure sum = hidden ? 0.0 : std::polar(1 / distance, -k * distance);
    for (const Rim& rim : rims) {
        const double length = glm::distance(rim.from, rim.to);
        const glm::dvec3 axis = (rim.to - rim.from) / length, normal = glm::cross(axis, rim.inward);
        WedgePath path;
        path.opening = 2 * M_PI;
        double along[2], radius[2], angle[2];
        for (int i = 0; i < 2; ++i) {
            const glm::dvec3 displacement = (i ? listener : source) - rim.from;
            along[i] = glm::dot(displacement, axis);
            radius[i] = std::hypot(glm::dot(displacement, rim.inward), glm::dot(displacement, normal));
            angle[i] = std::atan2(glm::dot(displacement, normal), glm::dot(displacement, rim.inward));
            if (angle[i] < 0) angle[i] += 2 * M_PI;
        }
        path.sourceRadius = radius[0];
        path.receiverRadius = radius[1];
        path.sourceAngle = angle[0];
        path.receiverAngle = angle[1];
        path.along = along[1] - along[0];
        const double shortest = along[0] + path.along * radius[0] / (radius[0] + radius[1]);
        const std::array<EdgePressure, 2> by = alongEdge(path, k, -shortest, length - shortest);
        sum += by[0] + by[1];
    }
    return 20 * std::log10(std::abs(sum) * distance);
}

TEST(EdgeEnds, RoundAScreenIsHeardWhatItsRimsBendAsFarAsTheyReach) {
    const Walled wall = screen();
    EXPECT_EQ(wall.edges(), 4);
    const glm::dvec3 source(.4, .7, 1.1);
    // Past an end of the screen's upper rim the level was 2 to 4 dB off, and a step of as much.
    for (const double x : {0.0, 3.0, 6.5, 7.0, 7.05, 7.1, 7.15, 7.2, 7.3, 8.0, 12.0})
        for (const double hz : {125.0, 500.0, 2000.0}) {
            const glm::dvec3 listener(x, .6, -4.5);
            const double distance = glm::distance(source, listener), exact = behindScreen(source, listener, hz);
            EXPECT_NEAR(heardAt(wall.traced(source, listener, 1), hz, distance), exact, .1) << x << ' ' << hz;
            // Sound along the screen from rim to rim is weak here.
            EXPECT_NEAR(heardAt(wall.traced(source, listener), hz, distance), exact, .32) << x << ' ' << hz;
        }
}

TEST(EdgeEnds, AnEdgeInPiecesIsAsOneInOnePiece) {
    const Walled whole = screen(), cut = screen(6, 2e-6);
    EXPECT_EQ(cut.edges(), 24);
    EXPECT_EQ(screen(6).edges(), 4);
    const glm::dvec3 source(.4, .7, 1.1);
    for (const double x : {.3, 2.6, 7.2}) {
        const glm::dvec3 listener(x, .6, -4.5);
        const TraceResult one = whole.traced(source, listener, 1), many = cut.traced(source, listener, 1);
        for (const double hz : {125.0, 500.0, 2000.0}) {
            EXPECT_NEAR(heardAt(many, hz, 5), heardAt(one, hz, 5), .05) << x << ' ' << hz;
            EXPECT_NEAR(heardAt(cut.traced(source, listener), hz, 5), heardAt(whole.traced(source, listener), hz, 5),
                        .3)
                << x << ' ' << hz << ": of pairs the shortest count";
        }
        // Where one piece goes on in the next one nothing is heard.
        EXPECT_LE(many.edges.waves.size(), one.edges.waves.size() + 1) << x;
    }
}

TEST(EdgeEnds, EnergyHasNoStepWhereTheShortestWayLeadsPast) {
    const Walled wall = screen();
    const glm::dvec3 source(.4, .7, 1.1);
    Bands last = total(wall.arrivals(source, {6, .6, -4.5}));
    for (double x = 6.05; x < 12; x += .05) {
        const Bands now = total(wall.arrivals(source, {x, .6, -4.5}));
        for (std::size_t b = 0; b <= kBand1k; ++b)
            ASSERT_NEAR(10 * std::log10(now[b] / last[b]), 0, .25) << x << ' ' << b;
        last = now;
    }
}

TEST(EdgeEnds, ShortEdgesBendLittle) {
    // A plate of 4 cm beside the way: at 125 Hz it changes little, as rims without ends it would much.
    const Walled plate({{-.02, -.02, 0}, {.02, -.02, 0}, {.02, .02, 0}, {-.02, .02, 0}}, {0, 1, 2, 0, 2, 3});
    const glm::dvec3 source(0, .3, 2), listener(.1, .2, -2);
    EXPECT_NEAR(heardAt(plate.traced(source, listener), 125, glm::distance(source, listener)), 0, .15);
}

TEST(EdgeEnds, WhatIsSaidToBendAtMostIsNotLess) {
    const unsigned seed = 1128;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto position = [&](double size) {
        std::uniform_real_distribution<double> each(-size, size);
        return glm::dvec3(each(random), each(random), each(random));
    };
    int past = 0, reported = 0;
    for (int i = 0; i < 20'000; ++i) {
        WallEdge edge;
        edge.from = position(3);
        edge.axis = glm::normalize(position(1));
        edge.length = std::exp(position(3).x);
        edge.faceA = glm::normalize(glm::cross(edge.axis, position(1)));
        edge.faceB = i % 2 ? edge.faceA : glm::normalize(glm::cross(edge.axis, position(1)));
        const glm::dvec3 source = position(5), listener = position(5);
        RoundEdge round;
        if (!pathRound(edge, source, listener, round) || !round.past()) continue;
        const double maximum =
            bentPastAtMost(edge, BesideEdge(edge, source, listener), glm::distance(source, listener));
        EXPECT_GE(maximum, bentPast(edge, round) * (1 - 1e-9)) << i;
        ++past;
        reported += std::isfinite(maximum);
    }
    EXPECT_GT(past, 1000);
    EXPECT_GT(reported, past * 9 / 10);
}

TEST(EdgePaths, AlongAFaceOneLooksAtAPlaceBesideTheEdge) {
    // Angles of less than a right angle, and of more; each face's plane seen from the air.
    for (const double degrees : {35.0, 60.0, 120.0, 150.0}) {
        WallEdge edge;
        edge.axis = {0, 0, 1};
        edge.length = 2;
        const double angle = degrees * M_PI / 180;
        edge.faceA = {1, 0, 0};
        edge.faceB = {std::cos(angle), std::sin(angle), 0};
        const glm::dvec3 position(0, 0, 1), away = -glm::normalize(edge.faceA + edge.faceB);
        const glm::dvec3 overA(0, -1, 0), overB(-std::sin(angle), std::cos(angle), 0);
        for (const auto& [face, over] : {std::pair(edge.faceA, overA), std::pair(edge.faceB, overB)}) {
            const auto aim = [&](double above) { return aimAt(edge, position, position + 2.0 * face + above * over); };
            EXPECT_GT(glm::dot(aim(1e-3) - position, away), 1e-5) << degrees << ": nearly along it";
            EXPECT_LT(glm::distance(aim(1e-3), position + away * glm::dot(aim(1e-3) - position, away)), 1e-12);
            EXPECT_EQ(aim(.1), position) << degrees << ": well above it";
            EXPECT_EQ(aim(-.1), position) << degrees << ": behind it";
        }
        EXPECT_EQ(aimAt(edge, position, position + 2.0 * away), position);
    }
}

/// A screen 20 m broad and so high that sound goes over it alone, and a post before it, of so many metres.
Walled screenBehindPost(double size, double x = 0) {
    std::vector<glm::dvec3> corners{{-10, -60, 0}, {10, -60, 0}, {10, 1, 0}, {-10, 1, 0}};
    std::vector<std::uint32_t> triangles{0, 1, 2, 0, 2, 3};
    if (size > 0) {
        for (int i = 0; i < 8; ++i)
            corners.emplace_back(x + (i & 1 ? .5 : -.5) * size, i & 2 ? 1.5 : .5, -.3 + (i & 4 ? .5 : -.5) * size);
        for (const std::uint32_t corner : {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5})
            triangles.push_back(4 + corner);
    }
    return {corners, triangles};
}

TEST(EdgeEnds, AnEdgeThatIsHiddenInPartBendsWithTheRest) {
    const Walled alone = screenBehindPost(0);
    const glm::dvec3 source(0, -.5, -2), listener(0, -.3, 2);
    // A rod before the place of the shortest way took the whole edge away: 14 dB.
    const Walled rod = screenBehindPost(.02);
    for (const double hz : {125.0, 500.0})
        EXPECT_NEAR(heardAt(rod.traced(source, listener), hz, 4), heardAt(alone.traced(source, listener), hz, 4), 1)
            << hz;
    // No step where the shortest way comes out behind a post.
    const Walled post = screenBehindPost(.2);
    double last = heardAt(post.traced(source, {-.3, -.3, 2}), 125, 4);
    for (double x = -.28; x <= .3; x += .02) {
        const double now = heardAt(post.traced(source, {x, -.3, 2}), 125, 4);
        EXPECT_NEAR(now, last, 1) << x;
        last = now;
    }
    // A body that stands on the edge covers a part of it.
    const auto standing = [](double low) {
        std::vector<glm::dvec3> corners{{-10, -60, 0}, {10, -60, 0}, {10, 1, 0}, {-10, 1, 0}};
        for (int i = 0; i < 8; ++i) corners.emplace_back(i & 1 ? .1 : -.1, i & 2 ? 2 : low, i & 4 ? .1 : -.1);
        std::vector<std::uint32_t> triangles{0, 1, 2, 0, 2, 3};
        for (const std::uint32_t corner : {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                           2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5})
            triangles.push_back(4 + corner);
        return Walled(corners, triangles);
    };
    const double on = heardAt(standing(1).traced(source, listener), 125, 4);
    EXPECT_NEAR(on, heardAt(standing(.5).traced(source, listener), 125, 4), 1);
    EXPECT_NEAR(on, heardAt(alone.traced(source, listener), 125, 4), 2);
    // A wall from x = 0 on hides the edge from the source where x is above 2: it ends there.
    const Walled half(
        {{-10, -60, 0}, {10, -60, 0}, {10, 1, 0}, {-10, 1, 0}, {0, -60, -1}, {10, -60, -1}, {10, 60, -1}, {0, 60, -1}},
        {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7});
    int ends = 0;
    for (const EdgeWave& wave : half.traced({-2, -.5, -2}, {-2, -.3, 2}, 1).edges.waves)
        ends += wave.route.first.y == 1 && std::abs(wave.route.first.x - 2) < .05;
    EXPECT_EQ(ends, 1);
}

TEST(EdgeEnds, AnEdgeIsSeenUpToWhatHidesItHoweverNearOneIs) {
    // The edge of the screen at y = 1; a wall before it from x = 0 on.
    for (const double size : {.1, 1.0, 30.0}) {
        const glm::dvec3 source(-.2 * size, .8 * size, -.4 * size), listener(-.2 * size, .9 * size, .4 * size);
        std::vector<glm::dvec3> corners{{-9, -9, 0},  {9, -9, 0},   {9, 1, 0},   {-9, 1, 0},
                                        {0, -9, -.2}, {9, -9, -.2}, {9, 9, -.2}, {0, 9, -.2}};
        for (glm::dvec3& corner : corners) corner *= size;
        const Walled walls(corners, {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7});
        WallEdge edge;
        edge.from = {-9 * size, size, 0};
        edge.axis = {1, 0, 0};
        edge.length = 18 * size;
        edge.faceA = edge.faceB = {0, -1, 0};
        const std::vector<EdgePart> parts = partsSeen(walls.geometry, source, listener, edge, {-.2 * size, size, 0});
        ASSERT_EQ(parts.size(), 1u) << size;
        EXPECT_EQ(parts[0].from, 0) << size;
        EXPECT_NEAR(parts[0].to, 9.2 * size, .01 * size) << size;
    }
}

}  // namespace
}  // namespace rtsg
