// Places on walls are moved off them: in corners of every angle to where they are before both walls.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "audio/triangle_geometry.h"
#include "images/image_sources.h"
#include "response/listening_positions.h"
#include "walled.h"

namespace rtsg {
namespace {

TEST(Places, InACornerOfAnyAngleAPlaceComesOffBothWalls) {
    for (const double degrees : {10.0, 20.0, 30.0, 60.0, 90.0, 140.0}) {
        const double angle = degrees * M_PI / 180;
        // Two walls from the z axis on; what lies between them is inside.
        const glm::dvec3 first(1, 0, 0), second(std::cos(angle), std::sin(angle), 0), up(0, 0, 1);
        test::TriangleGeometry corner;
        const std::uint32_t material = corner.addMaterial(.1, .1);
        for (const glm::dvec3& side : {first, second})
            corner.addQuad(-up, side * 5.0 - up, side * 5.0 + up, up, material);
        corner.finish();
        const glm::dvec3 inside = glm::normalize(first + second), position(0);
        const glm::dvec3 moved = offWalls(corner, position, inside * 3.0);
        const glm::dvec3 fromFirst(0, 1, 0), fromSecond(std::sin(angle), -std::cos(angle), 0);
        EXPECT_GT(glm::dot(moved, fromFirst), 1e-8) << degrees;
        EXPECT_GT(glm::dot(moved, fromSecond), 1e-8) << degrees;
        EXPECT_LT(glm::length(moved), 1e-4) << degrees;
    }
}

/// A cube with its middle in the origin, sides of 1 m.
test::Walled cube() {
    std::vector<glm::dvec3> corners;
    for (int i = 0; i < 8; ++i) corners.emplace_back(i & 1 ? .5 : -.5, i & 2 ? .5 : -.5, i & 4 ? .5 : -.5);
    return {corners, {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                      2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5}};
}

TEST(Places, OnAFaceOfABodyIsBeforeItAlsoBehindTheBody) {
    const test::Walled body = cube();
    const glm::dvec3 far(-3, .1, .2);
    // On a face, on an edge, and on a corner, all hidden by the body.
    for (const glm::dvec3& position : {glm::dvec3(.5, .1, .05), glm::dvec3(.5, .5, .05), glm::dvec3(.5, .5, .5)}) {
        const glm::dvec3 moved = outsideBodies(body.geometry, position, far);
        EXPECT_GT(std::max({moved.x, moved.y, moved.z}), .5);
        EXPECT_LT(glm::distance(moved, position), 1e-4);
        // It does not come back when it is asked about again.
        EXPECT_EQ(outsideBodies(body.geometry, moved, far), moved);
        EXPECT_EQ(offWalls(body.geometry, moved, far), moved);
    }
    // However near the other one is.
    EXPECT_GT(outsideBodies(body.geometry, {.5, .1, .05}, {-.4, .6, .1}).x, .5);
    // Seen from inside it is inside, and in sight of it before the face.
    EXPECT_LT(outsideBodies(body.geometry, {.5, .1, .05}, glm::dvec3(0)).x, .5);
    EXPECT_GT(outsideBodies(body.geometry, {.5, .1, .05}, {3, 0, 0}).x, .5);
}

TEST(Places, WhatBendsRoundABodyIsHeardOnItsFarFace) {
    const test::Walled body = cube();
    const glm::dvec3 source(-3, .1, .2);
    const auto level = [&](const glm::dvec3& from, const glm::dvec3& to) {
        return 10 * std::log10(test::total(body.arrivals(from, to))[kBand1k]);
    };
    const double before = level(source, {.5002, .1, .05});
    EXPECT_GT(before, -60);
    for (const double x : {.5, .500001, .499999}) {
        EXPECT_NEAR(level(source, {x, .1, .05}), before, .01) << x;
        EXPECT_NEAR(level({x, .1, .05}, source), before, .01) << x;
    }
}

/// A box, turned and moved, with places on its faces.
class RandomBox {
  public:
    explicit RandomBox(std::uint32_t seed) : random_(seed) {
        size_ = {in(.5, 3), in(.5, 3), in(.5, 3)};
        const glm::dvec3 z = glm::normalize(glm::dvec3(in(-1, 1), in(-1, 1), in(.1, 1)));
        const glm::dvec3 x = glm::normalize(glm::cross(glm::dvec3(in(-1, 1), 1.2, 0), z));
        rotation_ = glm::dmat3(x, glm::cross(z, x), z);
        middle_ = {in(-5, 5), in(-5, 5), in(-5, 5)};
    }
    /// Its faces face outwards, or inwards; mirrored by its transform or not.
    test::Walled walls(bool outwards, bool solid, bool mirrored) const {
        std::vector<glm::dvec3> corners;
        for (int i = 0; i < 8; ++i)
            corners.push_back(size_ * glm::dvec3(i & 1 ? .5 : -.5, i & 2 ? .5 : -.5, i & 4 ? .5 : -.5));
        std::vector<std::uint32_t> triangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                                2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
        if (!outwards) std::ranges::reverse(triangles);
        const glm::dvec3 x = rotation_[0] * (mirrored ? -1.0 : 1.0);
        return {corners, triangles, 0, {WorldFromLocal(x, rotation_[1], rotation_[2], middle_)}, solid};
    }
    /// Off a face by so much, outside or inside.
    glm::dvec3 at(int face, const glm::dvec3& position, double off) const {
        const int axis = face / 2;
        glm::dvec3 local = size_ * position;
        local[axis] = (face % 2 ? 1 : -1) * (.5 * size_[axis] + off);
        return middle_ + rotation_ * local;
    }
    double in(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
    int face() { return std::uniform_int_distribution<int>(0, 5)(random_); }

  private:
    std::mt19937 random_;
    glm::dvec3 size_{1}, middle_{0};
    glm::dmat3 rotation_{1};
};

double levelOf(const std::vector<Arrival>& arrivals) {
    return 10 * std::log10(test::total(arrivals)[kBand1k]);
}
bool isHeardStraight(const std::vector<Arrival>& arrivals) {
    return std::ranges::any_of(arrivals, [](const Arrival& one) { return one.order == 0; });
}

TEST(Places, BothOnTheFacesOfABodyAreOutsideOfIt) {
    for (std::uint32_t seed = 1; seed <= 40; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        RandomBox box(seed);
        const test::Walled body = box.walls(true, true, seed % 2 == 0);
        const int a = box.face(), b = box.face();
        const glm::dvec3 source(box.in(-.4, .4), box.in(-.4, .4), box.in(-.4, .4)),
            listener(box.in(-.4, .4), box.in(-.4, .4), box.in(-.4, .4));
        const auto off = [&](double metres) {
            return body.arrivals(box.at(a, source, metres), box.at(b, listener, metres));
        };
        const std::vector<Arrival> on = off(0), before = off(2e-4);
        EXPECT_EQ(isHeardStraight(on), a == b);
        EXPECT_EQ(isHeardStraight(before), a == b);
        EXPECT_NEAR(levelOf(on), levelOf(before), .1);
        // Played sound asks for direct sound by itself.
        const glm::dvec3 from = box.at(a, source, 0), to = box.at(b, listener, 0);
        EXPECT_EQ(directFraction(body.geometry, from, to)[kBand1k], a == b ? 1 : 0);
    }
}

TEST(Places, BothOnTheWallsOfARoomAreInsideOfIt) {
    for (std::uint32_t seed = 1; seed <= 40; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        RandomBox box(seed);
        // Walls that face inwards; or that have two sides, whichever way they are wound.
        const test::Walled room = box.walls(seed % 3 == 0, seed % 3 == 1, seed % 2 == 0);
        const int a = box.face(), b = box.face();
        const glm::dvec3 source(box.in(-.4, .4), box.in(-.4, .4), box.in(-.4, .4)),
            listener(box.in(-.4, .4), box.in(-.4, .4), box.in(-.4, .4));
        const auto off = [&](double metres) {
            return room.arrivals(box.at(a, source, metres), box.at(b, listener, metres));
        };
        const std::vector<Arrival> on = off(0), before = off(-2e-4);
        EXPECT_TRUE(isHeardStraight(on));
        EXPECT_NEAR(levelOf(on), levelOf(before), .02);
        EXPECT_EQ(directFraction(room.geometry, box.at(a, source, 0), box.at(b, listener, 0))[kBand1k], 1);
    }
}

TEST(Places, OnAFaceOfABodyWhatBendsIsWhatBendsBeforeIt) {
    for (std::uint32_t seed = 1; seed <= 60; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        RandomBox box(seed);
        const test::Walled body = box.walls(true, true, false);
        const glm::dvec3 away = box.at(0, {0, box.in(-1, 1), box.in(-1, 1)}, box.in(1, 3)),
                         position(box.in(-.4, .4), box.in(-.4, .4), box.in(-.4, .4));
        const int face = box.face();
        const auto energies = [&](double metres) {
            const glm::dvec3 at = box.at(face, position, metres);
            return test::total(seed % 2 ? body.arrivals(away, at) : body.arrivals(at, away));
        };
        const Bands on = energies(0), before = energies(2e-4);
        for (std::size_t b = 1; b < 8; ++b) EXPECT_NEAR(10 * std::log10(on[b] / before[b]), 0, .1) << b;
    }
}

TEST(Places, NoWayLeadsOutOfABodyFromNearItsFaces) {
    for (std::uint32_t seed = 1; seed <= 200; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        RandomBox box(seed);
        const test::Walled body = box.walls(true, true, false);
        const glm::dvec3 outside = box.at(0, glm::dvec3(0), 2);
        for (const double off : {1e-4, 2e-5}) {
            const glm::dvec3 inside = box.at(box.face(), {box.in(-.4, .4), box.in(-.4, .4), box.in(-.4, .4)}, -off);
            EXPECT_EQ(body.geometry.passage(inside, outside), Passage::none) << off;
        }
    }
}

TEST(Places, OnAFaceOfABodyAndInsideOfItIsInside) {
    for (std::uint32_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        RandomBox box(seed);
        const test::Walled body = box.walls(true, true, false);
        const glm::dvec3 position(box.in(-.4, .4), box.in(-.4, .4), box.in(-.4, .4));
        const glm::dvec3 on = box.at(box.face(), position, 0), inside = box.at(box.face(), position, -.1);
        EXPECT_EQ(directFraction(body.geometry, on, inside)[kBand1k], 1);
        EXPECT_TRUE(isHeardStraight(body.arrivals(on, inside)));
    }
}

TEST(Places, OnAGroundIsAboveItAlsoBehindAHill) {
    // A ridge along z, both slopes facing up, open below.
    const test::Walled hill({{-20, 0, -50}, {0, 5, -50}, {20, 0, -50}, {-20, 0, 50}, {0, 5, 50}, {20, 0, 50}},
                            {0, 3, 1, 1, 3, 4, 1, 4, 2, 2, 4, 5});
    const auto on = [](double x, double above) { return glm::dvec3(x, 5 - std::abs(x) / 4 + above, 1); };
    const auto level = [&](double above) {
        return 10 * std::log10(test::total(hill.arrivals(on(-6, above), on(8, .5)))[kBand1k - 2]);
    };
    const glm::dvec3 moved = outsideBodies(hill.geometry, on(-6, 0), on(8, .5));
    EXPECT_GT(moved.y, on(-6, 0).y);
    EXPECT_GT(level(.001), -60);
    EXPECT_NEAR(level(0), level(.001), .1);
}

TEST(Places, OnABodyInTheOpenNothingIsSentIntoIt) {
    const test::Walled body = cube();
    TraceOptions options;
    options.rays = 4000;
    options.air.absorbs = false;
    const auto escaped = [&](double y) {
        return AcousticTracer(body.geometry).trace(glm::dvec3(.1, y, .2), glm::dvec3(1, .8, .5), options).escaped[0];
    };
    // Half of it went into the body, and stayed there.
    EXPECT_NEAR(escaped(.5), 1, 1e-9);
    EXPECT_NEAR(escaped(.5001), 1, 1e-9);
}

TEST(Places, WhatTouchesABodyIsNotInIt) {
    const test::Walled body = cube();
    EXPECT_EQ(body.geometry.instancesAround(glm::dvec3(0), 2.5).size(), 1u);
    EXPECT_EQ(body.geometry.instancesAround(glm::dvec3(.1, .4999, .2), 2.5).size(), 1u);
    for (const glm::dvec3& position :
         {glm::dvec3(.1, .5, .2), glm::dvec3(.5, .5, .2), glm::dvec3(.5, .5, .5), glm::dvec3(0, .5001, 0)})
        EXPECT_TRUE(body.geometry.instancesAround(position, 2.5).empty());
    // A sheet has no inside: what is on it is its own sound.
    const test::Walled sheet({{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {0, 1, 2, 0, 2, 3});
    EXPECT_EQ(sheet.geometry.instancesAround(glm::dvec3(.1, .2, 0), 4).size(), 1u);
}

}  // namespace
}  // namespace rtsg
