// Which particles live when: their number, ages and lives against closed forms, and that every state is of itself.
#include <algorithm>
#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include <rtsg/core/emission.h>

namespace rtsg {
namespace {

EmissionSpan streamOf(double count, double lifetime, double variation) {
    EmissionSpan span;
    span.start = 1.7e9;
    span.count = count, span.lifetime = lifetime, span.lifetimeVariation = variation;
    return span;
}
std::size_t livingAt(const EmissionSpan& span, double since) {
    return livingParticles(std::span(&span, 1), 7, span.start + since).size();
}

// 40.4: as many as rate times lifetime, and never more than there may be.
TEST(Emission, AsManyLiveAsTheRateTimesTheLifetime) {
    const EmissionSpan even = streamOf(100, 5, 0), varied = streamOf(100, 5, .5);
    EXPECT_EQ(livingAt(even, -.01), 0u);
    EXPECT_EQ(livingAt(even, 0), 1u);
    EXPECT_EQ(livingAt(even, 1.01), 21u) << "20 a second, the first at 0";
    EXPECT_EQ(livingAt(even, 4.9501), 100u);
    for (double t = 5; t < 60; t += .37) {
        EXPECT_EQ(livingAt(even, t), 100u) << t;
        EXPECT_EQ(livingAt(varied, t), 100u) << t;
    }
}

TEST(Emission, LivesAreEvenlySpreadAboutTheLifetime) {
    EmissionSpan span = streamOf(20'000, 5, .4);
    span.explosive = 1;
    const auto born = livingParticles(std::span(&span, 1), 7, span.start);
    ASSERT_EQ(born.size(), 20'000u);
    double sum = 0, squares = 0;
    for (const LivingParticle& p : born) {
        EXPECT_EQ(p.age, 0);
        ASSERT_GE(p.life, 3);
        ASSERT_LE(p.life, 7);
        sum += p.life, squares += p.life * p.life;
    }
    const double mean = sum / 20'000, variance = squares / 20'000 - mean * mean;
    EXPECT_NEAR(mean, 5, .04) << "5 sigma of the mean";
    EXPECT_NEAR(variance, 16.0 / 12, .03);
    // All at once, and none after: at 5 s those of the longer half.
    EXPECT_NEAR(double(livingAt(span, 5)), 10'000, 360);
    EXPECT_EQ(livingAt(span, 7), 0u);
}

// A particle that lives at two times is the same one, older by what has passed; what comes after it in its place is
// born when it dies.
TEST(Emission, GrowOldAndMakePlace) {
    const EmissionSpan span = streamOf(50, 2, .8);
    std::map<std::pair<std::uint64_t, std::uint64_t>, std::pair<double, double>> seen;  // born, life
    for (double since = 0; since < 20; since += .01) {
        for (const LivingParticle& p : livingParticles(std::span(&span, 1), 7, span.start + since)) {
            const double born = since - p.age;
            const auto [one, isNew] = seen.try_emplace({p.slot, p.cycle}, std::pair(born, p.life));
            ASSERT_NEAR(one->second.first, born, 1e-6);
            ASSERT_EQ(one->second.second, p.life);
            ASSERT_LT(p.age, p.life);
            if (const auto before = seen.find({p.slot, p.cycle - 1}); isNew && p.cycle > 0 && before != seen.end()) {
                ASSERT_NEAR(before->second.first + before->second.second, born, 1e-6);
            }
        }
    }
    EXPECT_NEAR(double(seen.size()), 50 * 20 / 2.0, 60);
}

// Closing a span leaves living particles alone, and prevents new ones.
TEST(Emission, AClosedSpanDiesOut) {
    const EmissionSpan open = streamOf(100, 4, .5);
    EmissionSpan closed = open;
    closed.end = open.start + 10.25;
    EXPECT_EQ(livingAt(closed, 10.25), 100u);
    const auto agesAt = [&](const EmissionSpan& span, double since, double minimum) {
        std::vector<double> ages;
        for (const LivingParticle& p : livingParticles(std::span(&span, 1), 7, span.start + since))
            if (p.age > minimum) ages.push_back(p.age);
        std::ranges::sort(ages);
        return ages;
    };
    for (const double more : {.001, .5, 1.0, 3.0, 5.9}) {
        const auto goOn = agesAt(open, 10.25 + more, more), left = agesAt(closed, 10.25 + more, 0);
        ASSERT_EQ(goOn.size(), left.size()) << more;
        for (std::size_t i = 0; i < left.size(); ++i) EXPECT_NEAR(goOn[i], left[i], 1e-6);
    }
    EXPECT_EQ(livingAt(closed, 16.25), 0u);
    EXPECT_EQ(closed.over(), open.start + 16.25);
}

TEST(Emission, WhatFallsDueAsASpanEndsIsOfTheNext) {
    EmissionSpan span = streamOf(4, 4, 0);
    EXPECT_EQ(livingAt(span, 2), 3u) << "one a second, at 0, 1 and 2";
    span.end = span.start + 2;
    EXPECT_EQ(livingAt(span, 2), 2u);
    EXPECT_EQ(span.nextBirth(span.end), span.end);
    EmissionSpan alone = streamOf(1, 4, 0);
    alone.end = alone.start + 4;
    EXPECT_EQ(livingAt(alone, 4), 0u) << "its second falls due then";
    EXPECT_EQ(span.nextBirth(span.end + .25), span.end + 1);
}

TEST(Emission, SystemsAndSpansDrawTheirOwnNumbers) {
    const EmissionSpan span = streamOf(100, 5, 0);
    EmissionSpan next = span;
    next.serial = 1;
    const auto of = [](const EmissionSpan& s, std::uint32_t system) {
        return livingParticles(std::span(&s, 1), system, s.start + 9)[42].numbers(system).next();
    };
    EXPECT_EQ(of(span, 7), of(span, 7));
    EXPECT_NE(of(span, 7), of(span, 8));
    EXPECT_NE(of(span, 7), of(next, 7));
    KeyedNumbers numbers(1, 2, 3);
    int bins[10] = {};
    for (int i = 0; i < 100'000; ++i) {
        const double x = numbers.next();
        ASSERT_TRUE(x >= 0 && x < 1);
        ++bins[static_cast<int>(10 * x)];
    }
    double chi = 0;
    for (const int n : bins) chi += (n - 1e4) * (n - 1e4) / 1e4;
    EXPECT_LT(chi, 27.9) << "9 degrees of freedom, one in a thousand";
}

TEST(Emission, WhatIsStoredComesBackAndWhatCannotBeIsLeftOut) {
    EmissionSpan span = streamOf(3, 2, .1);
    span.end = span.start + 1, span.serial = 5, span.explosive = 1, span.size = {.1, .2}, span.speed = 3;
    span.variation = .3, span.mass = 4, span.surfaceArea = 5, span.angle = 1, span.position = {1, 2, 3};
    span.direction = {4, 5, 6};
    const Array<double> packed = packEmission(std::span(&span, 1));
    const auto back = unpackEmission(packed.span());
    ASSERT_EQ(back.size(), 1u);
    EXPECT_TRUE(packEmission(back) == packed);
    EXPECT_EQ(back[0].direction, Vec3d(4, 5, 6));
    EXPECT_EQ(back[0].end, span.end);
    for (std::size_t i = 0; i < packed.size(); ++i) {
        if (i == 6) continue;  // explosive: anything but 0
        Array<double> broken = packed;
        broken.mutableData()[i] = std::nan("");
        EXPECT_TRUE(unpackEmission(broken.span()).empty()) << i;
    }
    EXPECT_TRUE(unpackEmission(packed.span().first(packed.size() - 1)).empty());
    EmissionSpan many = streamOf(1e7, 2, .1);
    EXPECT_TRUE(unpackEmission(packEmission(std::span(&many, 1)).span()).empty());
    // Times far out and lives far too short: an answer, and soon.
    for (const double t : {-1e300, 1e18, 1e300}) (void)livingParticles(std::span(&span, 1), 7, t);
    const EmissionSpan brief = streamOf(1000, 1e-5, 1), none = streamOf(1000, 1e-9, 0);
    EXPECT_LE(livingAt(brief, 1e9), 1000u);
    EXPECT_EQ(livingAt(none, 1), 0u);
}

}  // namespace
}  // namespace rtsg
