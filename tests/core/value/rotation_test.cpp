// Rotations, quaternions and matrices of each other, beside glm's own.
#include <rtsg/core/rotation.h>

#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

namespace rtsg {
namespace {

double apartBy(const glm::dquat& a, const glm::dquat& b) {
    return glm::length(a - b);
}

TEST(CoreRotation, TurnsAreThoseOfGlm) {
    std::mt19937 random(5);
    const auto number = [&](double maximum) { return std::uniform_real_distribution(-maximum, maximum)(random); };
    for (int i = 0; i < 1000; ++i) {
        const glm::dvec3 axis = glm::normalize(glm::dvec3(number(1), number(1), number(1)));
        const double angle = number(7);
        EXPECT_LT(apartBy(rotationAround(axis, angle), glm::angleAxis(angle, axis)), 1e-15);
        const glm::dmat3 matrix = rotationMatrixOf(axis * 3.0, angle), theirs(glm::rotate(glm::dmat4(1), angle, axis));
        for (int column = 0; column < 3; ++column) EXPECT_LT(glm::length(matrix[column] - theirs[column]), 3e-15);
        const glm::dquat from = rotationAround(axis, angle),
                         to = glm::normalize(glm::dquat(number(1), number(1), number(1), number(1)));
        const double fraction = (number(1) + 1) / 2;
        EXPECT_LT(apartBy(alongShorterArc(from, to, fraction), glm::slerp(from, to, fraction)), 1e-12);
    }
}

TEST(CoreRotation, FieldsComeBackWithAnglesOfAtMostHalfATurn) {
    const Rotation turned = toRotation(toQuaternion({0, 3, 0, 5}));
    EXPECT_FLOAT_EQ(turned.y, -1);
    EXPECT_FLOAT_EQ(turned.angle, 2 * 3.14159265f - 5);
    EXPECT_EQ(toRotation({1, 0, 0, 0}), (Rotation{0, 0, 1, 0}));
    constexpr float kInf = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN();
    for (const Rotation& none :
         {Rotation{0, 0, 0, 1}, Rotation{kInf, 0, 0, 1}, Rotation{kNan, 1, 0, 1}, Rotation{0, 1, 0, kNan}})
        EXPECT_EQ(apartBy(toQuaternion(none), {1, 0, 0, 0}), 0);
}

TEST(CoreRotation, NeighboursAndEndsOfArcs) {
    const glm::dquat a = rotationAround({0, 1, 0}, .3), b = rotationAround({0, 1, 0}, .3 + 1e-9),
                     far = -rotationAround({0, 1, 0}, .4);
    EXPECT_LT(apartBy(alongShorterArc(a, b, .5), rotationAround({0, 1, 0}, .3 + .5e-9)), 1e-15);
    EXPECT_LT(apartBy(alongShorterArc(a, far, .5), rotationAround({0, 1, 0}, .35)), 1e-15);  // not the long way round
    EXPECT_LT(apartBy(alongShorterArc(a, far, 0), a), 1e-15);
    EXPECT_LT(apartBy(alongShorterArc(a, far, 1), -far), 1e-15);
}

}  // namespace
}  // namespace rtsg
