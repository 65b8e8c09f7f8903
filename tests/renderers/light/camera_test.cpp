// Rays and sky colours against closed forms.
#include <rtsg/renderers/camera.h>

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace rtsg {
namespace {

constexpr double kHalfTurn = std::numbers::pi;

void expectNear(const Vec3d& a, const Vec3d& b, double tolerance) {
    EXPECT_NEAR(a.x, b.x, tolerance);
    EXPECT_NEAR(a.y, b.y, tolerance);
    EXPECT_NEAR(a.z, b.z, tolerance);
}

double angleBetween(const Vec3d& a, const Vec3d& b) {
    return std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0));
}

// 23.3.1: the smaller of the picture's sides gets fieldOfView, the other follows from the aspect of the tangents.
TEST(Camera, FieldOfViewIsThatOfTheSmallerSide) {
    for (const double aspect : {0.25, 0.5, 1.0, 16.0 / 9, 4.0}) {
        const Camera camera = Camera::perspective(identityTransform(), {0, 0, 10}, {}, kHalfTurn / 4, aspect);
        const double horizontal = angleBetween(camera.ray(0, 0.5).direction, camera.ray(1, 0.5).direction);
        const double vertical = angleBetween(camera.ray(0.5, 0).direction, camera.ray(0.5, 1).direction);
        EXPECT_NEAR(std::min(horizontal, vertical), kHalfTurn / 4, 1e-9) << aspect;
        EXPECT_NEAR(std::tan(horizontal / 2) / std::tan(vertical / 2), aspect, 1e-9);
    }
}

TEST(Camera, LooksAlongMinusZWithYUp) {
    const Camera camera = Camera::perspective(identityTransform(), {1, 2, 3}, {}, 1, 1);
    expectNear(camera.position, {1, 2, 3}, 0);
    expectNear(camera.ray(0.5, 0.5).direction, {0, 0, -1}, 1e-12);
    EXPECT_LT(camera.ray(0, 0.5).direction.x, 0) << "x = 0 is the left edge";
    EXPECT_GT(camera.ray(0.5, 0).direction.y, 0) << "y = 0 is the top edge";
}

TEST(Camera, OrientationAndTransformsCompose) {
    // A quarter turn about y looks along -x; the transform about it then turns x to y.
    WorldFromLocal m = identityTransform();
    m[0] = {0, 1, 0}, m[1] = {-1, 0, 0}, m[3] = {10, 20, 30};
    const Camera camera = Camera::perspective(m, {1, 0, 0}, {0, 1, 0, static_cast<float>(kHalfTurn / 2)}, 1, 1);
    expectNear(camera.forward, {0, -1, 0}, 1e-6);
    expectNear(camera.position, {10, 21, 30}, 1e-9);
}

// 23.3.1: a viewpoint lies in the transformation hierarchy, so what its rays meet is what its rays would meet in its
// own space, taken through the same transform.
TEST(Camera, RaysGoTheWayOfTheTransformsAboveThem) {
    const WorldFromLocal transforms[] = {{{2, 0, 0}, {0, 5, 0}, {0, 0, 0.1}, {1, 2, 3}},
                                         {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}},
                                         {{1, 0, 0}, {0.7, 1, 0}, {0.2, 0.3, 1}, {-4, 0, 0}},
                                         {{0.234, 0, 0}, {0, 234, 0}, {0, 0, 12.23}, {0, 0, 0}},
                                         {{1e-7, 0, 0}, {0, 2e-7, 0}, {0, 0, 1e-7}, {0, 0, 0}}};
    const Vec3d position(1, -2, 3);
    const Rotation rotation{1, 1, 0, 0.5f};
    const std::array<double, 4> extent{-1, -2, 3, 1};
    for (const WorldFromLocal& m : transforms)
        for (const bool parallel : {false, true}) {
            const auto eye = [&](const WorldFromLocal& at) {
                return parallel ? Camera::parallel(at, position, rotation, extent, 1.5)
                                : Camera::perspective(at, position, rotation, 0.9, 1.5);
            };
            const Camera own = eye(identityTransform()), camera = eye(m);
            for (const Vec2d at : {Vec2d(.5, .5), Vec2d(0, 0), Vec2d(.9, .2)}) {
                const Camera::WorldRay local = own.ray(at.x, at.y), ray = camera.ray(at.x, at.y);
                const glm::dmat3 linear(m[0], m[1], m[2]);
                expectNear(ray.origin, linear * local.origin + m[3], 1e-9);
                expectNear(ray.direction, glm::normalize(linear * local.direction), 1e-9);
                EXPECT_NEAR(glm::length(camera.project(ray.origin + 7.0 * ray.direction) - at), 0, 1e-8);
            }
        }
}

TEST(Camera, AxesStayOrthonormalUnderScaleShearAndMirroring) {
    const WorldFromLocal transforms[] = {
        {{2, 0, 0}, {0, 5, 0}, {0, 0, 0.1}, {0, 0, 0}},     {{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}},
        {{1, 0, 0}, {0.7, 1, 0}, {0.2, 0.3, 1}, {0, 0, 0}}, {{1, 0, 0}, {0, 0, 0}, {0, 0, 1}, {0, 0, 0}},
        {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}},       {{1e-20, 0, 0}, {0, 1e-20, 0}, {0, 0, 1e-20}, {0, 0, 0}}};
    for (const WorldFromLocal& m : transforms) {
        const Camera camera = Camera::perspective(m, {0, 0, 0}, {1, 1, 0, 0.5f}, 1, 1), all = camera.around();
        const glm::dmat3 axes = camera.axes();
        expectNear(glm::cross(axes[0], axes[1]), axes[2], 1e-9);
        expectNear(axes[2], -camera.forward, 1e-12);
        EXPECT_NEAR(glm::length(camera.forward), 1, 1e-12);
        EXPECT_NEAR(glm::dot(axes[0], axes[1]), 0, 1e-12);
        expectNear(glm::cross(all.right, all.up), -all.forward, 1e-9);
        EXPECT_NEAR(glm::length(camera.ray(.1, .7).direction), 1, 1e-9);
    }
}

// A flat frame has no space to look from: the view is turned, and nothing more.
TEST(Camera, WhatIsFlatIsSeenWithoutItsScale) {
    const WorldFromLocal flat{{1, 0, 0}, {0, 0, 0}, {0, 0, 1}, {0, 0, 0}};
    const Camera camera = Camera::perspective(flat, {0, 0, 0}, {}, 1, 1);
    EXPECT_EQ(camera.right, Vec3d(1, 0, 0));
    EXPECT_EQ(camera.up, Vec3d(0, 1, 0));
}

TEST(Camera, PixelsAreNoWiderThanTheirSpaceInAnyDirection) {
    const Camera even = Camera::perspective(identityTransform(), {0, 0, 0}, {}, 1, 1),
                 high = Camera::perspective({{1, 0, 0}, {0, 3, 0}, {0, 0, 1}, {0, 0, 0}}, {0, 0, 0}, {}, 1, 1);
    EXPECT_NEAR(even.pixel(100), 2 * std::tan(.5) / 100, 1e-12);
    const Camera small = Camera::perspective({{1, 0, 0}, {0, .25, 0}, {0, 0, 1}, {0, 0, 0}}, {0, 0, 0}, {}, 1, 1);
    EXPECT_NEAR(high.pixel(100), even.pixel(100), 1e-12) << "no wider than that across";
    EXPECT_NEAR(small.pixel(100), .25 * even.pixel(100), 1e-12);
}

// Between two frames the stretch changes evenly, as edges do.
TEST(Camera, OnItsWayItsStretchChangesToo) {
    const Camera from = Camera::perspective({{1, 0, 0}, {0, 3, 0}, {0, 0, 1}, {0, 0, 0}}, {0, 0, 0}, {}, 1, 1),
                 to = Camera::perspective({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}, {0, 0, 0}, {}, 1, 1);
    expectNear(to.since(from, .25).up, {0, 2.5, 0}, 1e-12);
    expectNear(to.since(from, .25).right, {1, 0, 0}, 1e-12);
}

TEST(Camera, BadAnglesAndAxesAreSurvived) {
    for (const double angle : {0.0, -1.0, 4.0, 1e9, double(NAN)})
        for (const Rotation rotation : {Rotation{0, 0, 0, 1}, Rotation{NAN, 0, 0, 1}, Rotation{0, 1, 0, INFINITY}}) {
            const Camera camera = Camera::perspective(identityTransform(), {0, 0, 0}, rotation, angle, 1);
            const auto ray = camera.ray(0.1, 0.9);
            EXPECT_NEAR(glm::length(ray.direction), 1, 1e-9);
        }
}

TEST(Camera, OrthoViewpointShowsItsExtent) {
    const Camera wide = Camera::parallel(identityTransform(), {0, 0, 10}, {}, {-1, -2, 3, 2}, 2);
    expectNear(wide.ray(0, 0.5).origin, {-3, 0, 10}, 1e-12);  // 4 by 4 metres grow to 8 by 4
    expectNear(wide.ray(1, 0).origin, {5, 2, 10}, 1e-12);
    expectNear(wide.ray(0.2, 0.7).direction, {0, 0, -1}, 1e-12);
}

TEST(Camera, FramingShowsAllCorners) {
    const Vec3d lower(-3, 1, -20), upper(5, 2, 8);
    for (const double aspect : {0.5, 1.0, 3.0}) {
        for (const bool orthographic : {false, true}) {
            Camera camera =
                orthographic ? Camera::parallel(identityTransform(), {0, 0, 0}, {0, 1, 0, 0.7f}, {-1, -1, 1, 1}, aspect)
                             : Camera::perspective(identityTransform(), {0, 0, 0}, {0, 1, 0, 0.7f}, 0.7854, aspect);
            camera.frame(lower, upper);
            double widest = 0;
            for (int corner = 0; corner < 8; ++corner) {
                const Vec3d p(corner & 1 ? upper.x : lower.x, corner & 2 ? upper.y : lower.y,
                              corner & 4 ? upper.z : lower.z);
                const Vec3d d = p - camera.position;
                const double depth = glm::dot(d, camera.forward);
                EXPECT_GT(depth, 0);
                const double scale = orthographic ? 1 : depth;
                const double x = glm::dot(d, camera.right) / scale, y = glm::dot(d, camera.up) / scale;
                EXPECT_TRUE(x >= camera.left && x <= camera.rightEdge && y >= camera.bottom && y <= camera.top);
                widest = std::max({widest, std::abs(x) / camera.rightEdge, std::abs(y) / camera.top});
            }
            EXPECT_GT(widest, 0.75) << "and not from far away";
        }
    }
}

TEST(Camera, FramingAPointKeepsADistance) {
    Camera camera = Camera::perspective(identityTransform(), {0, 0, 0}, {}, 0.7854, 1);
    camera.frame({1, 1, 1}, {1, 1, 1});
    EXPECT_GT(camera.position.z, 1);
    const Camera before = camera;
    camera.frame({1, 1, 1}, {-1, -1, -1});
    EXPECT_EQ(camera.position, before.position) << "an empty box changes nothing";
}

// 23.3.1: the view aims at the middle of the box around everything, from where the viewpoint is, and shows all of it.
TEST(Camera, ViewingAllAimsAtTheMiddle) {
    const Vec3d eye(10, 5, 10), lower(-1, 0, -1), upper(1, 2, 1), middle(0, 1, 0);
    Camera camera = Camera::perspective(identityTransform(), eye, {0, 1, 0, 2.f}, 0.7854, 1.5);
    camera.viewAll(lower, upper, {0, 1, 0});
    const Vec3d forward = glm::normalize(middle - eye);
    EXPECT_NEAR(glm::distance(camera.forward, forward), 0, 1e-12);
    EXPECT_NEAR(camera.right.y, 0, 1e-12) << "upright";
    EXPECT_GT(camera.up.y, 0);
    for (int corner = 0; corner < 8; ++corner) {
        const Vec2d seen = camera.project({corner & 1 ? 1 : -1, corner & 2 ? 2 : 0, corner & 4 ? 1 : -1});
        EXPECT_TRUE(seen.x > 0 && seen.x < 1 && seen.y > 0 && seen.y < 1) << corner;
    }
    // From straight before a face, the ball around the box is as high as the picture: its radius over the tangent of
    // half the angle.
    camera = Camera::perspective(identityTransform(), {0, 1, 30}, {0, 1, 0, 2.f}, 0.7854, 1.5);
    camera.viewAll(lower, upper, {0, 1, 0});
    EXPECT_NEAR(glm::distance(camera.position, Vec3d(0, 1, std::sqrt(3.0) / std::tan(0.7854 / 2))), 0, 1e-6);
    Camera parallel = Camera::parallel(identityTransform(), eye, {}, {-9, -9, 9, 9}, 1);
    parallel.viewAll(lower, upper, {0, 1, 0});
    EXPECT_NEAR(glm::distance(parallel.forward, forward), 0, 1e-12);
    EXPECT_LT(parallel.top, std::sqrt(3.0) * 1.06);
    EXPECT_GT(parallel.top, 1);
}

TEST(Camera, ViewingAllCutsNoCornerOff) {
    // A slab along the view whose near edge leaves the ball's cone: 65 degrees from the line to the eye.
    const Vec3d lower(-1e-3, -.91, -.414), upper(1e-3, .91, .414);
    Camera camera = Camera::perspective(identityTransform(), {0, 0, 10}, {}, 0.7854, 1);
    camera.viewAll(lower, upper, {0, 1, 0});
    for (const double y : {lower.y, upper.y}) {
        const Vec2d seen = camera.project({0, y, upper.z});
        EXPECT_GE(seen.y, 0);
        EXPECT_LE(seen.y, 1);
    }
}

TEST(Camera, WhoCannotTurnViewsAllAsHeLooks) {
    for (const Vec3d& eye : {Vec3d(0, 0, 0), Vec3d(0, 7, 0)}) {  // in the middle of it; straight above
        Camera camera = Camera::perspective(identityTransform(), eye, {0, 1, 0, .5f}, 0.7854, 1);
        const Camera before = camera;
        camera.viewAll({-1, -1, -1}, {1, 1, 1}, {0, 1, 0});
        EXPECT_EQ(camera.forward, before.forward);
        EXPECT_EQ(camera.up, before.up);
        EXPECT_NEAR(glm::length(camera.position + camera.forward * glm::length(camera.position)), 0, 1e-9);
    }
    Camera camera = Camera::perspective(identityTransform(), {1, 2, 3}, {}, 0.7854, 1);
    camera.viewAll({1, 1, 1}, {-1, -1, -1}, {0, 1, 0});
    EXPECT_EQ(camera.position, Vec3d(1, 2, 3)) << "an empty box changes nothing";
}

// 24.2.1: skyAngle from the zenith, groundAngle from the nadir, linear in the angle in between. A point on ray() of a
// place in the picture is projected to this place again, near or far, for each kind of eye.
TEST(Camera, PlacesAreWhereRaysGo) {
    const Camera straight = Camera::perspective(identityTransform(), {1, 2, 3}, {.1f, 1, .2f, .7f}, .9, 1.5),
                 parallel = Camera::parallel(identityTransform(), {1, 2, 3}, {.1f, 1, .2f, .7f}, {-2, -1, 3, 4}, 1.5),
                 stretched =
                     Camera::perspective({{2, 0, 0}, {.3, 1, 0}, {.1, 0, 1}, {0, 0, 0}}, {1, 2, 3}, {}, .9, 1.5);
    for (const Camera& camera :
         {straight, parallel, straight.around(), straight.beside(.3, 4), stretched.beside(.3, 4)})
        for (const Vec2d at : {Vec2d(.5, .5), Vec2d(.1, .8), Vec2d(.97, .02)})
            for (const double distance : {.5, 20.0}) {
                const Camera::WorldRay ray = camera.ray(at.x, at.y);
                EXPECT_NEAR(glm::length(camera.project(ray.origin + distance * ray.direction) - at), 0, 1e-12);
            }
    EXPECT_TRUE(std::isinf(straight.project(straight.position - straight.forward).x));
}

TEST(Camera, OnItsWayItTurnsEvenlyAndGoesStraight) {
    const Camera from = Camera::perspective(identityTransform(), {0, 0, 10}, {0, 1, 0, .2f}, .9, 1),
                 to = Camera::perspective(identityTransform(), {4, 0, 2}, {0, 1, 0, 1.4f}, .5, 1);
    const Camera half = to.since(from, .5),
                 expected = Camera::perspective(identityTransform(), {2, 0, 6}, {0, 1, 0, .8f}, .9, 1);
    EXPECT_NEAR(glm::length(half.position - expected.position), 0, 1e-12);
    EXPECT_NEAR(glm::length(half.forward - expected.forward), 0, 1e-6);
    EXPECT_NEAR(glm::length(half.right - expected.right), 0, 1e-6);
    EXPECT_NEAR(half.top, (from.top + to.top) / 2, 1e-12);
    EXPECT_NEAR(glm::length(to.since(from, 0).forward - from.forward), 0, 1e-12);
    Camera other = from;
    other.viewpoint = NodeId{7};
    EXPECT_EQ(to.since(other, 0).position, to.position) << "a cut";
    EXPECT_EQ(to.since(from.around(), 0).position, to.position);
}

TEST(Sky, GradientIsLinearInTheAngle) {
    Sky sky;
    sky.skyColors = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    sky.skyAngles = {0.5f, 1.5f};
    sky.groundColors = {{1, 1, 0}, {0, 1, 1}};
    sky.groundAngles = {1.0f};
    const auto at = [&](double fromZenith) {
        return Vec3f(
            sky.color({static_cast<float>(std::sin(fromZenith)), static_cast<float>(std::cos(fromZenith)), 0}));
    };
    const auto expect = [&](double angle, Vec3f color) {
        const Vec3f seen = at(angle);
        EXPECT_NEAR(seen.r, color.r, 1e-3) << angle;
        EXPECT_NEAR(seen.g, color.g, 1e-3) << angle;
        EXPECT_NEAR(seen.b, color.b, 1e-3) << angle;
    };
    expect(0, {1, 0, 0});
    expect(0.25, {0.5f, 0.5f, 0});
    expect(1.0, {0, 0.5f, 0.5f});
    expect(1.5, {0, 0, 1});
    expect(2.0, {0, 0, 1});  // the last colour goes on to the nadir where there is no ground
    expect(kHalfTurn - 1.0 + 1e-3, {0.0f, 1, 1});
    expect(kHalfTurn - 0.25, {0.75f, 1, 0.25f});
    expect(kHalfTurn, {1, 1, 0});
}

TEST(Sky, LonelyGroundColorReachesTheHorizon) {
    Sky sky;
    sky.skyColors = {{0, 0, 1}};
    sky.groundColors = {{1, 0, 0}};
    EXPECT_EQ(Vec3f(sky.color({0.8f, -0.6f, 0})), Vec3f(1, 0, 0));
    EXPECT_EQ(Vec3f(sky.color({0.8f, 0.6f, 0})), Vec3f(0, 0, 1));
}

TEST(Sky, PanoramaSidesAreSeenFromInside) {
    // Each side: red grows to the right, green upwards, blue tells which side.
    Sky sky;
    for (std::size_t side = 0; side < 6; ++side) {
        std::vector<Vec4f> pixels;
        for (int y = 0; y < 2; ++y)
            for (int x = 0; x < 2; ++x) pixels.emplace_back(float(x), float(y), float(side), 1);
        sky.panorama[side] = std::make_shared<const Texture>(*Texture::fromFloats(pixels, 2, 2));
    }
    const struct {
        Vec3d forward, right, up;
    } sides[] = {{{0, 0, -1}, {1, 0, 0}, {0, 1, 0}},  {{0, 0, 1}, {-1, 0, 0}, {0, 1, 0}},
                 {{-1, 0, 0}, {0, 0, -1}, {0, 1, 0}}, {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
                 {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}},   {{0, -1, 0}, {1, 0, 0}, {0, 0, -1}}};
    for (int i = 0; i < 6; ++i) {
        const auto look = [&](double x, double y) {
            return sky.color(Vec3f(glm::normalize(sides[i].forward + x * sides[i].right + y * sides[i].up)));
        };
        EXPECT_NEAR(look(0, 0).b, i, 1e-5);
        EXPECT_NEAR(look(0.5, 0.5).r, 1, 1e-5);
        EXPECT_NEAR(look(0.5, 0.5).g, 1, 1e-5);
        EXPECT_NEAR(look(-0.5, 0.5).r, 0, 1e-5);
        EXPECT_NEAR(look(-0.5, -0.5).g, 0, 1e-5);
    }
}

TEST(Sky, TransparencyIsCoverage) {
    Sky sky;
    sky.skyColors = {{1, 0.5f, 0}};
    sky.alpha = 0.25f;
    EXPECT_EQ(sky.color({0, 1, 0}), Vec4f(0.25f, 0.125f, 0, 0.25f));
}

}  // namespace
}  // namespace rtsg
