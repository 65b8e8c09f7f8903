// Sound round cylinders and spheres beside exact series.
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "edges/diffraction_route.h"
#include "images/followed_edges.h"
#include "rigid_round.h"
#include "round_levels.h"
#include "round_shapes.h"
#include "walled.h"

namespace rtsg {
namespace {

using namespace test;

Walled bodyOf(bool ball, double radius, int sides) {
    return (ball ? sphereMesh(radius, sides) : cylinderMesh(radius, -60, 60, sides)).walled();
}
RoundValue exactBeside(bool ball, const BesideRound& at, double hz) {
    const double k = 2 * M_PI * hz / 343;
    return ball ? besideRigidSphere(at, k) : besideRigidCylinder(at, k);
}
TraceResult tracedAt(const Walled& body, const BesideRound& at, double turned = 0) {
    return body.traced(about(at.source, turned, 0), about(at.listener, turned + at.angle * 180 / M_PI, at.along));
}

/// In the dark and in the light, tones from 63 Hz to 4 kHz; `near` and `far`: m off the surface.
struct Compared {
    Errors dark, lit;

    Compared(bool ball, std::uint64_t seed, int positions, double near, double far) {
        std::mt19937_64 random(seed);
        std::uniform_real_distribution<double> uniform(0, 1);
        for (int i = 0; i < positions; ++i) {
            BesideRound at;
            at.radius = .1 * std::pow(20, uniform(random));
            at.source = at.radius + .3 * std::pow(16, uniform(random));
            at.listener = at.radius + near * std::pow(far / near, uniform(random));
            at.angle = M_PI * uniform(random);
            at.along = ball || i % 2 == 0 ? 0 : 2 * uniform(random);
            const TraceResult traced = tracedAt(bodyOf(ball, at.radius, 48), at, 360 * uniform(random));
            for (std::size_t tone = 7; tone < 40; tone += 4) {
                const RoundValue exact = exactBeside(ball, at, edgeToneHz(static_cast<double>(tone)));
                (at.isLit() ? lit : dark)
                    .add(decibelsOf(traced, tone, at.distance()) - decibelsOf(exact, at.distance()));
            }
        }
    }
};

TEST(RoundBodies, TonesRoundACylinderAreThoseOfTheSeries) {
    const Compared all(false, 7, 16, .3, 4.8);
    EXPECT_GT(all.dark.count, 30);
    EXPECT_LT(all.dark.rms(), 1);
    EXPECT_LT(all.dark.worst, 3);
    EXPECT_LT(all.lit.rms(), .4);
    EXPECT_LT(all.lit.worst, 1.6);
}

TEST(RoundBodies, TonesRoundASphereAreThoseOfTheSeries) {
    const Compared all(true, 7, 60, .3, 4.8);
    EXPECT_GT(all.dark.count, 40);
    EXPECT_LT(all.dark.rms(), .7);
    EXPECT_LT(all.dark.worst, 2);
    EXPECT_LT(all.lit.rms(), .4);
    EXPECT_LT(all.lit.worst, 1.5);
}

TEST(RoundBodies, NextToTheSurfaceToo) {
    for (const bool ball : {false, true}) {
        const Compared all(ball, 11, ball ? 16 : 6, .005, .3);
        EXPECT_GT(all.dark.count, 12);
        EXPECT_LT(all.dark.rms(), 1.8) << ball;
        EXPECT_LT(all.dark.worst, 4.6) << ball;
        EXPECT_LT(all.lit.rms(), 1.5) << ball;
        EXPECT_LT(all.lit.worst, 4) << ball;
    }
}

TEST(RoundBodies, OnTheSurfaceToo) {
    for (const bool ball : {false, true}) {
        const Compared all(ball, 13, ball ? 16 : 6, 1e-6, .002);
        EXPECT_GT(all.dark.count, 12);
        EXPECT_LT(all.dark.rms(), 1.5) << ball;
        EXPECT_LT(all.dark.worst, 4) << ball;
        EXPECT_LT(all.lit.rms(), 1.5) << ball;
        EXPECT_LT(all.lit.worst, 4) << ball;
    }
}

/// Beside a centimetre off, where the series ends soon: the field does not change across the surface.
TEST(RoundBodies, WithBothOnTheSurface) {
    const Walled column = bodyOf(false, .5, 48);
    for (const double degrees : {120.0, 180.0})
        for (const std::size_t tone : {7u, 15u, 23u}) {
            BesideRound at{.5, .51, .51, degrees * M_PI / 180, 0};
            const double exact = decibelsOf(exactBeside(false, at, edgeToneHz(static_cast<double>(tone))), 1);
            for (const double height : {0.0, 1e-5, 2e-4, 1e-3, 5e-3}) {
                at.source = at.listener = .5 + height;
                EXPECT_NEAR(decibelsOf(tracedAt(column, at), tone, 1), exact, 7.5)
                    << degrees << " degrees, " << height << " m, tone " << tone;
            }
        }
}

TEST(RoundBodies, AtTheListenersPlaceDirectSoundStays) {
    const Walled column = bodyOf(false, .5, 48);
    for (const double apart : {0.0, 1e-6, 1e-4, 9e-3}) {
        const TraceResult traced = column.traced({-1.5, 0, 0}, {-1.5 + apart, 0, 0});
        double energy = 0;
        for (const Arrival& arrival : traced.arrivals) energy += 4 * M_PI * arrival.energy[3];
        EXPECT_NEAR(energy, 1e4, 10) << apart;
    }
}

/// Exporters round coordinates to a millimetre, and scales are seldom quite even.
TEST(RoundBodies, NearlyRoundOnesBendAsRoundOnes) {
    const BesideRound at{.3, 1.5, 1.5, 179 * M_PI / 180, 0};
    const auto levels = [&](const Walled& body) {
        const TraceResult traced = tracedAt(body, at, 5);
        std::vector<double> result;
        for (std::size_t tone = 7; tone < 28; tone += 4) result.push_back(decibelsOf(traced, tone, at.distance()));
        return result;
    };
    const auto expectAlike = [](const std::vector<double>& a, const std::vector<double>& b, const std::string& what) {
        for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], .4) << what << ", tone " << 7 + 4 * i;
    };
    const std::vector<double> column = levels(bodyOf(false, .3, 48)), ball = levels(bodyOf(true, .3, 48));
    for (const int sides : {16, 24, 32, 64}) {
        RoundMesh mesh = cylinderMesh(.3, -60, 60, sides);
        for (glm::dvec3& corner : mesh.corners) corner = glm::round(corner * 1000.0) / 1000.0;
        expectAlike(levels(mesh.walled()), column, std::to_string(sides) + " sides in millimetres");
    }
    for (const double scale : {1.0003, 1.003}) {
        WorldFromLocal uneven(1.0);
        uneven[0][0] = scale;
        expectAlike(levels(cylinderMesh(.3, -60, 60, 48).walled(0, {uneven})), column, std::to_string(scale));
        expectAlike(levels(sphereMesh(.3, 48).walled(0, {uneven})), ball, std::to_string(scale));
    }
    expectAlike(levels(bodyOf(false, .3, 2000)), column, "2,000 sides");
    for (const int sides : {16, 24, 32}) expectAlike(levels(bodyOf(true, .3, sides)), ball, std::to_string(sides));
}

TEST(RoundBodies, RoundTheEndOfAWallNothingJumps) {
    std::vector<glm::dvec3> outline;
    for (int i = 0; i <= 12; ++i) outline.push_back(about(.2, 15 * i, 0));
    outline.emplace_back(-.2, -4, 0);
    outline.emplace_back(.2, -4, 0);
    const Walled wall = drawn(outline, 60).walled();
    const glm::dvec3 source(1.5, -.5, 30);
    std::vector<double> before;
    for (int step = 0; step <= 14; ++step) {  // the straight way comes into the circle after .07 m
        const glm::dvec3 listener(-1.5, -.3 + .05 * step, 30);
        const TraceResult traced = wall.traced(source, listener);
        std::vector<double> levels;
        for (std::size_t tone = 7; tone < 28; tone += 4) levels.push_back(decibelsOf(traced, tone, 1));
        for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(levels[i], before[i], 1.5) << step << ", " << i;
        before = levels;
    }
}

TEST(RoundBodies, OctavesOnAWayRoundTheBodyAreTheirMeans) {
    for (const bool ball : {false, true}) {
        const Walled body = bodyOf(ball, .5, 48);
        Errors errors;
        for (double degrees = 180; degrees > 60; degrees -= 18) {
            const BesideRound at{.5, 2, 1.5, degrees * M_PI / 180, 0};
            const Bands heard = total(tracedAt(body, at).arrivals);
            for (const std::size_t band : {1u, 2u, 4u, 6u}) {
                double mean = 0;
                for (int i = 0; i < 9; ++i)
                    mean += std::norm(exactBeside(ball, at, kBandHz[band] * std::exp2((i + .5) / 9 - .5))) / 9;
                errors.add(10 * std::log10(4 * M_PI * heard[band] / mean));
            }
        }
        EXPECT_LT(errors.rms(), .75) << ball;
        EXPECT_LT(errors.worst, 2.1) << ball;
    }
}

TEST(RoundBodies, NothingJumpsWhereTheShadowBegins) {
    // Facets of few sides end up to 3 cm before the circle: direct sound is heard a little into its shadow.
    const BesideRound edge{.5, 2, 1.5, 0, 0};
    const double begins = (std::acos(.5 / edge.source) + std::acos(.5 / edge.listener)) * 180 / M_PI;
    for (const bool ball : {false, true})
        for (const int sides : {12, 48}) {
            const Walled body = bodyOf(ball, .5, sides);
            double jump = 0, jumpOfOctaves = 0;
            std::vector<double> before(8), octavesBefore(8);
            for (double degrees = begins - 5; degrees < begins + 5; degrees += .25) {
                BesideRound at = edge;
                at.angle = degrees * M_PI / 180;
                const TraceResult traced = tracedAt(body, at, 1.3);
                const Bands octaves = total(traced.arrivals);
                for (std::size_t band = 1; band < 8; ++band) {
                    const double level = decibelsOf(traced, 5 * band + 2, at.distance());
                    const double octave = 10 * std::log10(octaves[band]);
                    if (degrees > begins - 5) {
                        jump = std::max(jump, std::abs(level - before[band]));
                        jumpOfOctaves = std::max(jumpOfOctaves, std::abs(octave - octavesBefore[band]));
                    }
                    before[band] = level;
                    octavesBefore[band] = octave;
                }
            }
            EXPECT_LT(jump, .5) << ball << " of " << sides;
            EXPECT_LT(jumpOfOctaves, .4) << ball << " of " << sides;
        }
}

TEST(RoundBodies, ImpulseResponsesHaveThem) {
    for (const bool ball : {false, true}) {
        const BesideRound at{.3, 2, 1.2, 165 * M_PI / 180, 0};
        const TraceResult traced = tracedAt(bodyOf(ball, .3, 48), at);
        for (const double hz : {100.0, 300.0, 1000.0, 3000.0})
            EXPECT_NEAR(heardAt(traced, hz, at.distance()), decibelsOf(exactBeside(ball, at, hz), at.distance()), 1.5)
                << ball << " at " << hz;
    }
}

TEST(RoundBodies, WhatMovesBehindItIsFollowed) {
    const BesideRound at{.5, 2, 1.5, 165 * M_PI / 180, .4};
    const glm::dvec3 source = about(at.source, 0, 0), listener = about(at.listener, 165, at.along);
    const TraceResult traced = bodyOf(false, .5, 48).traced(source, listener);
    TraceOptions options;
    options.air.absorbs = false;
    std::vector<FollowedImage> followed;
    addFollowedEdges(traced.echogram(), source, listener, options, 48000, 256, 16, followed);
    int sides = 0;
    for (const FollowedImage& one : followed) {
        const double pathLength = traced.edges.waves[one.arrival].seconds * 343;
        if (pathLength > 6) continue;  // by the far ends of the cylinder
        ++sides;
        // The shortest way, of two centimetres on.
        const glm::dvec3 moved = source + glm::dvec3(-.01, .02, .01);
        const auto shortest = [&](const glm::dvec3& position) {
            const double radius = std::hypot(position.x, position.y), angle = std::atan2(position.y, position.x);
            const double by = pathLength < 3.6 ? 165 * M_PI / 180 - angle : 195 * M_PI / 180 + angle;
            return std::hypot(std::sqrt(radius * radius - .25) + std::sqrt(1.5 * 1.5 - .25) +
                                  .5 * (by - std::acos(.5 / radius) - std::acos(.5 / 1.5)),
                              at.along - position.z);
        };
        EXPECT_NEAR(edgePath(one.edge->route, source, listener).length, shortest(source), 1e-5);
        EXPECT_NEAR(edgePath(one.edge->route, moved, listener).length, shortest(moved), 2e-4);
    }
    EXPECT_EQ(sides, 2);
}

TEST(RoundBodies, TwoCylindersOnEachOtherAreOne) {
    WorldFromLocal up(1.0), down(1.0);
    up[3] = {0, 0, 30.4};
    down[3] = {0, 0, -29.6};
    const Walled two = cylinderMesh(.5, -30, 30, 24).walled(0, {up, down}), one = bodyOf(false, .5, 24);
    for (const double degrees : {180.0, 150.0, 134.0, 131.0, 110.0}) {
        const BesideRound at{.5, 2, 1.5, degrees * M_PI / 180, .9};
        const TraceResult both = tracedAt(two, at), whole = tracedAt(one, at);
        for (std::size_t tone = 7; tone < 40; tone += 4)
            EXPECT_NEAR(decibelsOf(both, tone, 1), decibelsOf(whole, tone, 1), .65) << degrees << " tone " << tone;
        for (std::size_t band = 1; band < 8; ++band)
            EXPECT_NEAR(10 * std::log10(total(both.arrivals)[band] / total(whole.arrivals)[band]), 0, .2);
    }
}

TEST(RoundBodies, OnAFloorAColumnDoesNotEnd) {
    RoundMesh mesh = turned({{.5, -1}, {.5, 60}}, 24);
    const auto n = static_cast<std::uint32_t>(mesh.corners.size());
    for (const glm::dvec3& corner : {glm::dvec3(-80, -80, -1), {80, -80, -1}, {80, 80, -1}, {-80, 80, -1}})
        mesh.corners.push_back(corner);
    mesh.addQuad(n, n + 1, n + 2, n + 3);
    const Walled column = mesh.walled();
    for (const double degrees : {180.0, 150.0}) {
        const BesideRound at{.5, 2, 1.5, degrees * M_PI / 180, 0};
        const TraceResult traced = tracedAt(column, at);
        // With its image in the floor it goes on below that, where the source's image is. One tone may be where both
        // sides cancel each other.
        BesideRound image = at;
        image.along = 2;
        Errors errors;
        for (std::size_t tone = 7; tone < 40; tone += 4) {
            const double hz = edgeToneHz(static_cast<double>(tone));
            errors.add(decibelsOf(traced, tone, at.distance()) -
                       decibelsOf(exactBeside(false, at, hz) + exactBeside(false, image, hz), at.distance()));
        }
        EXPECT_LT(errors.rms(), 1.3) << degrees;
    }
}

TEST(RoundBodies, ThinRodsAreNotThereForLongWaves) {
    for (const double radius : {.05, .02, .005})
        for (const double degrees : {180.0, 120.0, 30.0}) {
            const BesideRound at{radius, 1.5, .4, degrees * M_PI / 180, 0};
            const TraceResult traced = tracedAt(bodyOf(false, radius, 24), at);
            for (std::size_t tone = 7; tone < 40; tone += 4)
                EXPECT_NEAR(decibelsOf(traced, tone, at.distance()),
                            decibelsOf(exactBeside(false, at, edgeToneHz(static_cast<double>(tone))), at.distance()),
                            1.5)
                    << radius << " at " << degrees << " tone " << tone;
        }
}

TEST(RoundBodies, ItsEdgesArePairedNoMore) {
    const BesideRound at{.5, 2, 1.5, M_PI, 0};
    EXPECT_EQ(tracedAt(sphereMesh(.5, 48).walled(), at).edgePairs.leftOut, 0u);
}

TEST(RoundBodies, InARoundRoomNothingIsAdded) {
    const Walled room = cylinderMesh(3, -1.5, 1.5, 32).walled(.2);
    EXPECT_TRUE(room.traced({1, 1, 0}, {-1, .5, .3}).edges.waves.empty());
}

}  // namespace
}  // namespace rtsg
