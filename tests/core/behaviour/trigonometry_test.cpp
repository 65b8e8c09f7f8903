// Sine, cosine and arc tangent beside those of the mathematical library in long doubles.
#include "animation/trigonometry.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

TEST(Trigonometry, SinesAndCosinesAreThoseOfTheLibrary) {
    std::mt19937_64 random(11);
    double worst = 0;
    const auto look = [&](double angle) {
        const SineCosine found = sineCosine(angle);
        worst = std::max({worst, static_cast<double>(std::abs(found.sine - std::sin(static_cast<long double>(angle)))),
                          static_cast<double>(std::abs(found.cosine - std::cos(static_cast<long double>(angle))))});
    };
    for (const double maximum : {1e-9, .5, 3.2, 7., 100., 1e5})
        for (int i = 0; i < 20'000; ++i) look(std::uniform_real_distribution(-maximum, maximum)(random));
    for (int i = -64; i <= 64; ++i) {
        const double at = i * (std::numbers::pi / 8);
        for (const double angle : {at, std::nextafter(at, 1e9), std::nextafter(at, -1e9)}) look(angle);
    }
    EXPECT_LE(worst, 3e-16);
    for (const double tiny : {0., 1e-300, 1e-20, 3e-9}) {
        EXPECT_EQ(sineCosine(tiny).sine, tiny);
        EXPECT_EQ(sineCosine(-tiny).cosine, 1);
    }
}

TEST(Trigonometry, FarAnglesAndWhatIsNoAngleAreAsInTheLibrary) {
    for (const double angle : {1.1e5, -3e8, 1e300}) {
        EXPECT_EQ(sineCosine(angle).sine, std::sin(angle));
        EXPECT_EQ(sineCosine(angle).cosine, std::cos(angle));
    }
    for (const double angle : {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
        EXPECT_TRUE(std::isnan(sineCosine(angle).sine));
        EXPECT_TRUE(std::isnan(sineCosine(angle).cosine));
    }
}

TEST(Trigonometry, AnglesOfTheFirstQuadrantAreThoseOfTheLibrary) {
    std::mt19937_64 random(12);
    double worst = 0;
    const auto look = [&](double y, double x) {
        const long double angle = std::atan2(static_cast<long double>(y), static_cast<long double>(x));
        worst = std::max(worst, static_cast<double>(std::abs(quadrantAngle(y, x) - angle) / angle));
    };
    for (int i = 0; i < 100'000; ++i) {
        const double angle = std::uniform_real_distribution(0., std::numbers::pi / 2)(random);
        look(std::sin(angle), std::cos(angle));
        look(std::exp(-20 * angle), 1);
        look(1, std::exp(-20 * angle));
    }
    look(1, 1);
    look(1, 0);
    look(1e-300, 1);
    EXPECT_LE(worst, 5e-16);
    EXPECT_EQ(quadrantAngle(0, 1), 0);
}

}  // namespace
}  // namespace rtsg
