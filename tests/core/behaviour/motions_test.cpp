// HAnimMotion: turns in the order of the channels against matrices, any number of frames at once against one by one,
// and what a motion that rests costs.
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include <fmt/format.h>
#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/x3d.h>

#include "core/scene_check.h"

namespace rtsg {
namespace {

using test::Loaded;
using M = x3d::HAnimMotion;
using J = x3d::HAnimJoint;

std::string humanoid(const std::string& motion) {
    return "DEF H HAnimHumanoid { skeleton DEF R HAnimJoint { name \"r\" } joints USE R motions DEF M HAnimMotion { " +
           motion + " } }";
}

TEST(Motions, TurnsAreDoneInTheOrderOfTheChannelsTheLastOneFirst) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> degrees(-400, 400);
    const std::string orders[] = {"XYZ", "ZXY", "ZYX", "YXZ", "XZY", "YZX", "XYX", "Z", "YX"};
    for (const std::string& order : orders) {
        std::string channels = std::to_string(order.size()), values;
        glm::dmat4 expected(1);
        for (const char axis : order) {
            const double angle = std::round(degrees(random) * 8) / 8;  // exact as a float
            channels += fmt::format(" {}rotation", axis);
            values += fmt::format(" {}", angle);
            const glm::dvec3 about(axis == 'X', axis == 'Y', axis == 'Z');
            expected = expected * glm::rotate(glm::dmat4(1), angle * M_PI / 180, about);
        }
        Loaded a(humanoid(fmt::format("joints \"r\" channels \"{}\" values [{}]", channels, values)));
        ASSERT_TRUE(a.usable) << a.problems();
        a.scene.newFrame(1);
        const Rotation r = a.scene.node(a.named("R")).get(J::rotation);
        const glm::dmat4 turned = glm::rotate(glm::dmat4(1), double(r.angle), glm::dvec3(r.x, r.y, r.z));
        for (int c = 0; c < 3; ++c)
            EXPECT_LT(glm::length(turned[c] - expected[c]), 1e-6) << channels << values << " column " << c;
    }
}

/// 0, 1, 2 ... as places.
std::string countingMotion(int frames, const std::string& more) {
    std::string values;
    for (int i = 0; i < frames; ++i) values += fmt::format(" {}", i);
    return humanoid("joints \"r\" channels \"1 Xposition\" frameDuration .125 " + more + " values [" + values + "]");
}

TEST(Motions, ManyFramesAtOnceEndWhereOneByOneEnd) {
    std::mt19937 random(11);
    const auto any = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
    for (int trial = 0; trial < 200; ++trial) {
        const int frames = any(1, 9), start = any(0, frames), end = any(0, frames);
        const std::string more =
            fmt::format("startFrame {} endFrame {} frameIncrement {} frameIndex {} loop {}", start, end,
                        any(0, 1) ? any(1, 4) : any(-4, -1), any(0, frames), any(0, 1) ? "TRUE" : "FALSE");
        Loaded byOne(countingMotion(frames, more)), atOnce(countingMotion(frames, more));
        ASSERT_TRUE(byOne.usable && atOnce.usable);
        byOne.scene.newFrame(0);
        atOnce.scene.newFrame(0);
        int at = 0;
        for (int jump = 0; jump < 6; ++jump) {
            const int until = at + any(1, 40);
            while (at < until) byOne.scene.newFrame(++at * .125);
            atOnce.scene.newFrame(until * .125);
            const Node& one = byOne.scene.node(byOne.named("M"));
            const Node& other = atOnce.scene.node(atOnce.named("M"));
            EXPECT_EQ(one.get(M::frameIndex), other.get(M::frameIndex)) << more << " at " << at;
            EXPECT_EQ(one.get(M::elapsedTime), other.get(M::elapsedTime)) << more << " at " << at;
            EXPECT_EQ(one.get(M::cycleTime), other.get(M::cycleTime)) << more << " at " << at;
            EXPECT_EQ(byOne.scene.node(byOne.named("R")).get(J::translation),
                      atOnce.scene.node(atOnce.named("R")).get(J::translation));
        }
    }
}

TEST(Motions, ACenturyOfFramesAtOnceIsOneStep) {
    Loaded a(countingMotion(8, "loop TRUE"));
    a.scene.newFrame(0);
    a.scene.newFrame(3.2e9);  // 2.56e10 frames, a multiple of 8
    EXPECT_EQ(a.scene.node(a.named("M")).get(M::frameIndex), 0);
    EXPECT_EQ(a.scene.node(a.named("M")).get(M::cycleTime).seconds, 3.2e9);
}

TEST(Motions, BetweenTwoFramesAndAfterTheLastOneNothingChanges) {
    Loaded a(countingMotion(3, ""));
    a.scene.newFrame(0);
    EXPECT_TRUE(a.scene.newFrame(.05)->changes.empty());
    EXPECT_FALSE(a.scene.newFrame(.13)->changes.empty());
    EXPECT_FALSE(a.scene.newFrame(.5)->changes.empty());
    EXPECT_TRUE(a.scene.newFrame(.6)->changes.empty());
    // A later setting of the joint stays.
    ASSERT_TRUE(a.scene.set(a.named("R"), J::translation, Vec3f(7, 7, 7)));
    a.scene.newFrame(9);
    EXPECT_EQ(a.scene.node(a.named("R")).get(J::translation), Vec3f(7, 7, 7));
}

}  // namespace
}  // namespace rtsg
