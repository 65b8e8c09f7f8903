// Splines, squad and ease against closed forms in double precision.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

struct Interpolator {
    Scene scene;
    double t = 0;
    explicit Interpolator(const std::string& node) {
        Diagnostics diagnostics("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nDEF I " + node, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
    }
    template <class T>
    T at(Field<float> set, Field<T> output, double fraction) {
        const NodeId id = scene.findName("I");
        EXPECT_TRUE(scene.sendEvent(id, set.index, Value(static_cast<float>(fraction))));
        scene.newFrame(++t);
        return scene.node(id).get(output);
    }
    std::string problems() {
        std::string text;
        for (const Diagnostic& d : scene.diagnostics().all()) text += d.text + '\n';
        return text;
    }
};

TEST(Splines, ACubicGivenByItsVelocitiesComesOutAsItIs) {
    // p(u) = 2 + 3u - 4u^2 + u^3 on [0, 1], its derivatives 3 and -2.
    using N = x3d::SplineScalarInterpolator;
    Interpolator i("SplineScalarInterpolator { key [ 0 1 ] keyValue [ 2 2 ] keyVelocity [ 3 -2 ] }");
    for (double u = 0; u <= 1; u += .05)
        EXPECT_NEAR(i.at(N::set_fraction, N::value_changed, u), 2 + 3 * u - 4 * u * u + u * u * u, 2e-6) << u;
}

TEST(Splines, EvenlySpacedKeysWithoutVelocitiesAreCatmullAndRoms) {
    using N = x3d::SplinePositionInterpolator;
    const glm::dvec3 p[5] = {{0, 0, 0}, {1, 3, -1}, {4, 2, 2}, {5, -2, 0}, {9, 1, 1}};
    Interpolator i(
        "SplinePositionInterpolator { key [ 0 .25 .5 .75 1 ] keyValue [ 0 0 0, 1 3 -1, 4 2 2, 5 -2 0, 9 1 1 ] }");
    for (int segment = 1; segment < 3; ++segment)
        for (double u = 0; u < 1; u += .1) {
            const double u2 = u * u, u3 = u2 * u;
            const glm::dvec3 expected =
                .5 * (2.0 * p[segment] + (p[segment + 1] - p[segment - 1]) * u +
                      (2.0 * p[segment - 1] - 5.0 * p[segment] + 4.0 * p[segment + 1] - p[segment + 2]) * u2 +
                      (-p[segment - 1] + 3.0 * p[segment] - 3.0 * p[segment + 1] + p[segment + 2]) * u3);
            const Vec3f value = i.at(N::set_fraction, N::value_changed, (segment + u) / 4);
            EXPECT_LT(glm::length(glm::dvec3(value) - expected), 5e-6) << segment << ' ' << u;
        }
}

TEST(Splines, AClosedPathGoesOnSmoothlyWhereItBegan) {
    using N = x3d::SplinePositionInterpolator2D;
    const std::string keys = "key [ 0 .25 .5 .75 1 ] keyValue [ 1 0, 0 1, -1 0, 0 -1, 1 0 ] ";
    Interpolator closed("SplinePositionInterpolator2D { closed TRUE " + keys + "}"),
        open("SplinePositionInterpolator2D { " + keys + "}");
    const double h = 1e-3;
    const auto slope = [&](Interpolator& i, double u) {
        return (glm::dvec2(i.at(N::set_fraction, N::value_changed, u + h)) -
                glm::dvec2(i.at(N::set_fraction, N::value_changed, u))) /
               h;
    };
    const glm::dvec2 leaves = slope(closed, 0), arrives = slope(closed, 1 - h);
    EXPECT_LT(glm::length(leaves - arrives), .1);
    EXPECT_NEAR(leaves.y, 4, .05);  // half of the way between the neighbours, a quarter of the time
    EXPECT_LT(glm::length(slope(open, 0)), .1);
}

TEST(Splines, NormalizedVelocitiesHaveTheLengthOfThePath) {
    // Two keys, a path of length 5: a velocity (0, 2) becomes (0, 5).
    using N = x3d::SplinePositionInterpolator2D;
    Interpolator i(
        "SplinePositionInterpolator2D { normalizeVelocity TRUE key [ 0 1 ] keyValue [ 0 0, 3 4 ] keyVelocity [ 0 2, 0 "
        "2 ] }");
    const double u = .5;
    const glm::dvec2 expected = glm::dvec2(3, 4) * (3 * u * u - 2 * u * u * u) +
                                glm::dvec2(0, 5) * (u * u * u - 2 * u * u + u) + glm::dvec2(0, 5) * (u * u * u - u * u);
    EXPECT_LT(glm::length(glm::dvec2(i.at(N::set_fraction, N::value_changed, u)) - expected), 1e-6);
}

TEST(Splines, UnevenKeysWeighTheTangentAsTheClauseDoes) {
    // At key .2 between 0 and 1: factors 2 * .2 leaving, 2 * .8 arriving; the tangent there is (v2 - v0) / 2 = 3.
    using N = x3d::SplineScalarInterpolator;
    Interpolator i("SplineScalarInterpolator { key [ 0 .2 1 ] keyValue [ 0 1 6 ] }");
    const double u = .5;
    EXPECT_NEAR(i.at(N::set_fraction, N::value_changed, .1), 0 * .5 + 1 * .5 + 3 * 1.6 * (u * u * u - u * u), 1e-6);
    EXPECT_NEAR(i.at(N::set_fraction, N::value_changed, .6), 1 * .5 + 6 * .5 + 3 * .4 * (u * u * u - 2 * u * u + u),
                1e-6);
}

TEST(Splines, KeysThatAreEqualDisorderedOrTooFewGiveFiniteValues) {
    using N = x3d::SplineScalarInterpolator;
    for (const char* node :
         {"SplineScalarInterpolator { key [ 0 .5 .5 1 ] keyValue [ 0 1 2 3 ] }",
          "SplineScalarInterpolator { key [ 1 .5 0 ] keyValue [ 0 1 2 ] }",
          "SplineScalarInterpolator { key [ 0 0 0 ] keyValue [ 0 1 0 ] closed TRUE }",
          "SplineScalarInterpolator { key [ .5 ] keyValue [ 3 ] }",
          "SplineScalarInterpolator { key [ 0 1 ] keyValue [ 3 ] }",
          "SplineScalarInterpolator { key [ 0 .5 1 ] keyValue [ 0 1 2 ] keyVelocity [ 1 2 3 4 ] }"}) {
        Interpolator i(node);
        for (double u = -.5; u <= 1.5; u += .125)
            EXPECT_TRUE(std::isfinite(i.at(N::set_fraction, N::value_changed, u))) << node;
    }
}

TEST(Splines, SquadAboutOneAxisIsTheCubicOfTheAngles) {
    // About one axis quaternions are angles: squad is lerp(lerp(a, b), lerp(sa, sb), 2u(1-u)).
    using N = x3d::SquadOrientationInterpolator;
    const double angle[4] = {0, .5, 1.4, 1.6};
    Interpolator i(
        "SquadOrientationInterpolator { key [ 0 .3 .6 1 ] keyValue [ 0 1 0 0, 0 1 0 .5, 0 1 0 1.4, 0 1 0 1.6 ] }");
    const auto inner = [&](int k) {
        return k == 0 || k == 3 ? angle[k] : angle[k] - (angle[k - 1] - 2 * angle[k] + angle[k + 1]) / 4;
    };
    const double key[4] = {0, .3, .6, 1};
    for (int k = 0; k < 3; ++k)
        for (double u = .1; u < 1; u += .2) {
            const double line = angle[k] + (angle[k + 1] - angle[k]) * u,
                         bend = inner(k) + (inner(k + 1) - inner(k)) * u;
            const Rotation r = i.at(N::set_fraction, N::value_changed, key[k] + (key[k + 1] - key[k]) * u);
            EXPECT_NEAR(double(r.y) * r.angle, line + (bend - line) * 2 * u * (1 - u), 1e-5) << k << ' ' << u;
        }
}

TEST(Splines, SquadGoesTheShorterWayAndStaysFinite) {
    using N = x3d::SquadOrientationInterpolator;
    // 350 degrees is 10 back.
    Interpolator i("SquadOrientationInterpolator { key [ 0 1 ] keyValue [ 0 0 1 0, 0 0 1 6.1086524 ] }");
    const Rotation half = i.at(N::set_fraction, N::value_changed, .5);
    EXPECT_NEAR(std::remainder(double(half.z) * half.angle, 2 * std::numbers::pi), -5 * std::numbers::pi / 180, 1e-5);
    Interpolator opposite(
        "SquadOrientationInterpolator { key [ 0 .5 1 ] keyValue [ 0 0 1 0, 0 0 1 3.14159265, 1 0 0 3.1 ] }");
    for (double u = 0; u <= 1; u += .05) {
        const Rotation r = opposite.at(N::set_fraction, N::value_changed, u);
        EXPECT_TRUE(std::isfinite(r.x + r.y + r.z + r.angle)) << u;
    }
}

TEST(Splines, EaseIsSmoothAndMeetsItsParabolas) {
    using N = x3d::EaseInEaseOut;
    Interpolator i("EaseInEaseOut { key [ 0 1 ] easeInEaseOut [ 0 .3, .2 0 ] }");
    const double out = .3, in = .2, t = 1 / (2 - out - in);
    for (double u = 0; u <= 1; u += .025) {
        const double expected = u < out       ? t / out * u * u
                                : u <= 1 - in ? t * (2 * u - out)
                                              : 1 - t * (1 - u) * (1 - u) / in;
        EXPECT_NEAR(i.at(N::set_fraction, N::modifiedFraction_changed, u), expected, 1e-6) << u;
    }
    Interpolator plain("EaseInEaseOut { key [ 0 1 ] easeInEaseOut [ 0 0, 0 0 ] }");
    for (double u = 0; u <= 1; u += .25)
        EXPECT_NEAR(plain.at(N::set_fraction, N::modifiedFraction_changed, u), u, 1e-7);
    // More than the whole is scaled down to it.
    Interpolator over("EaseInEaseOut { key [ 0 1 ] easeInEaseOut [ 0 3, 1 0 ] }");
    EXPECT_NEAR(over.at(N::set_fraction, N::modifiedFraction_changed, .75), .75, 1e-6);
    EXPECT_NEAR(over.at(N::set_fraction, N::modifiedFraction_changed, .375), .1875, 1e-6);
}

}  // namespace
}  // namespace rtsg
