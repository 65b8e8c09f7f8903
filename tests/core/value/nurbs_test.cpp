// B-splines against their polynomials, and rational ones against circles.
#include <rtsg/core/nurbs.h>

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

TEST(NurbsBasis, AddsUpToOneAndItsSlopesToNone) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> any(0, 1);
    for (int order = 2; order <= NurbsBasis::kMaxOrder; ++order) {
        const std::size_t count = static_cast<std::size_t>(order) + 5;
        std::vector<double> knots;
        double at = -3;
        for (std::size_t i = 0; i < count + static_cast<std::size_t>(order); ++i)
            knots.push_back(at += i % 3 ? any(random) : 0);
        bool replaced = true;
        const NurbsBasis basis(order, count, knots, &replaced);
        EXPECT_FALSE(replaced);
        for (int i = 0; i <= 50; ++i) {
            const double u = basis.first() + (basis.last() - basis.first()) * i / 50;
            const NurbsBasis::At here = basis.at(u);
            ASSERT_LE(here.start + static_cast<std::size_t>(order), count);
            double sum = 0, slopes = 0;
            for (int k = 0; k < order; ++k) {
                EXPECT_GE(here.value[static_cast<std::size_t>(k)], -1e-12);
                sum += here.value[static_cast<std::size_t>(k)], slopes += here.slope[static_cast<std::size_t>(k)];
            }
            EXPECT_NEAR(sum, 1, 1e-9);
            EXPECT_NEAR(slopes, 0, 1e-6);
        }
    }
}

TEST(NurbsBasis, OneSpanIsBernsteins) {
    const double knots[] = {0, 0, 0, 0, 1, 1, 1, 1};
    const NurbsBasis cubic(4, 4, knots);
    for (const double t : {0., .2, .5, .9, 1.}) {
        const NurbsBasis::At b = cubic.at(t);
        const double s = 1 - t;
        const double expected[] = {s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t};
        const double slopes[] = {-3 * s * s, 3 * s * s - 6 * s * t, 6 * s * t - 3 * t * t, 3 * t * t};
        for (std::size_t i = 0; i < 4; ++i) {
            EXPECT_NEAR(b.value[i], expected[i], 1e-14);
            EXPECT_NEAR(b.slope[i], slopes[i], 1e-13);
        }
    }
}

TEST(NurbsCurve, AQuarterCircleHasItsRadiusAndItsTangent) {
    const double knots[] = {0, 0, 0, 1, 1, 1};
    const double root = std::sqrt(.5);
    const Vec3d points[] = {{2, 0, 1}, {2 * root, 2 * root, root}, {0, 2, 1}};
    const double weights[] = {1, root, 1};
    const NurbsCurve curve{NurbsBasis(3, 3, knots), nurbsPoints(points, weights)};
    for (int i = 0; i <= 20; ++i) {
        Vec3d slope;
        const Vec3d p = curve.at(i / 20., &slope);
        EXPECT_NEAR(std::hypot(p.x, p.y), 2, 1e-13);
        EXPECT_NEAR(p.x * slope.x + p.y * slope.y, 0, 1e-12);
        EXPECT_NEAR(p.z, 1, 1e-14);
    }
}

TEST(NurbsBasis, KnotsThatDoNotFitAreReplaced) {
    bool replaced = false;
    for (const std::vector<double>& bad :
         {std::vector<double>{}, {0, 1}, {0, 1, 2, 1, 4, 5}, {0, 0, 0, 0, 0, 0}, {0, 1, 2, NAN, 4, 5}}) {
        const NurbsBasis basis(3, 3, bad, &replaced);
        EXPECT_TRUE(replaced);
        EXPECT_EQ(basis.breaks(), (std::vector<double>{0, 1}));
        (void)basis.at(NAN), (void)basis.at(1e300), (void)basis.at(-1e300);
    }
    // Five of order 3: three pieces, whose ends are the outer points, or that go on beyond as they began.
    const NurbsBasis clamped(3, 5, {}), periodic(3, 5, {}, nullptr, NurbsBasis::EvenEnds::periodic);
    const std::vector<double> thirds{0, 1 / 3., 2 / 3., 1};
    EXPECT_EQ(clamped.breaks(), thirds);
    EXPECT_EQ(periodic.breaks(), thirds);
    EXPECT_EQ(clamped.at(0).value[0], 1);
    EXPECT_EQ(clamped.at(1).value[2], 1);
    for (const double u : {0., 1 / 3., 2 / 3.}) {
        EXPECT_NEAR(periodic.at(u).value[0], .5, 1e-12) << u;
        EXPECT_NEAR(periodic.at(u).value[1], .5, 1e-12) << u;
    }
    EXPECT_FALSE(NurbsBasis::fits(1, 5));
    EXPECT_FALSE(NurbsBasis::fits(3, 2));
    EXPECT_FALSE(NurbsBasis::fits(NurbsBasis::kMaxOrder + 1, 100));
}

TEST(NurbsSurface, NormalsOfAPlaneWithAPole) {
    // All points of the first row coincide.
    const double knots[] = {0, 0, 1, 1};
    const Vec3d points[] = {{0, 0, 0}, {0, 0, 0}, {-1, 1, 0}, {1, 1, 0}};
    const NurbsSurface s{NurbsBasis(2, 2, knots), NurbsBasis(2, 2, knots), nurbsPoints(points, {})};
    for (const double u : {0., .5, 1.})
        for (const double v : {0., .5, 1.}) EXPECT_NEAR(s.normal(u, v).z, 1, 1e-9) << u << " " << v;
}

}  // namespace
}  // namespace rtsg
