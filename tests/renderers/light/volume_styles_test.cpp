// Render styles, segments and surfaces of volumes, each against the formula of its clause.
#include <rtsg/core/x3d.h>

#include "light_scene.h"
#include "volume_scene.h"

namespace rtsg {
namespace {

using namespace test;

Vec3f styled(const std::string& body, Integrator integrator = Integrator::whitted) {
    LightScene s(body);
    s.options.settings.integrator = integrator;
    if (integrator == Integrator::whitted) s.options.settings.colorSpace = ColorSpace::display;
    return s.center();
}

/// Values that rise by `step` a voxel along x (0) or z (2), `middle` in the middle of eight; seen along z.
std::string slopeVoxels(int axis, int middle, int step) {
    return voxels(8, 8, 8, [&](int x, int, int z) { return middle + step * (axis == 0 ? x - 4 : z - 4) + step / 2; });
}
/// The share of light left behind a volume of 8 voxels of one opacity.
double leftOfEight(double opacity) {
    return std::pow(1 - opacity, 8);
}
/// How opaque one voxel of a volume is that is even along z: what is left of a white wall behind a black volume.
double opacityOf(const std::string& body) {
    const double left = styled(body + behind(3, "1 1 1")).r - styled(body + behind(3, "0 0 0")).r;
    return 1 - std::pow(left, 1 / 8.);
}

// 41.4.2: O (k_gc + k_gs |df|^k_ge), df from voxel to voxel.
TEST(VolumeStyles, BoundaryEnhancementGoesByTheGradient) {
    const double v = 100 / 255., g = 10 / 255.;
    const auto of = [&](double k, double s, double e) {
        return opacityOf(volume(slopeVoxels(0, 100, 10),
                                fmt::format("BoundaryEnhancementVolumeStyle {{ retainedOpacity {} boundaryOpacity {} "
                                            "opacityFactor {} }}",
                                            k, s, e)));
    };
    EXPECT_NEAR(of(1, 0, 2), v, 1e-4);
    EXPECT_NEAR(of(0, 1, 1), v * g, 1e-4);
    EXPECT_NEAR(of(.2, .9, .5), v * (.2 + .9 * std::sqrt(g)), 1e-4);
    EXPECT_NEAR(of(.5, 1, 0), std::min(v * 1.5, 1.), 1e-4);
}

// 41.4.11: O (k_sc + k_ss (1 - |n V|)^k_se).
TEST(VolumeStyles, SilhouettesGoByTheAngle) {
    const std::string style =
        "SilhouetteEnhancementVolumeStyle { silhouetteRetainedOpacity .3 silhouetteBoundaryOpacity .6 "
        "silhouetteSharpness 2 }";
    EXPECT_NEAR(opacityOf(volume(slopeVoxels(0, 100, 10), style)), 100 / 255. * .9, 1e-4) << "across the view";
    const double angle = .7;
    // Normals that the author gives: (n + 1) / 2 in 8 bits.
    const auto byte = [](double x) { return int(std::lround((x + 1) / 2 * 255)); };
    const int nx = byte(std::sin(angle)), ny = byte(0), nz = byte(std::cos(angle));
    std::string normals = "surfaceNormals PixelTexture3D { image [ 3 1 1 8";
    for (int i = 0; i < 8; ++i) normals += fmt::format(" {}", nx << 16 | ny << 8 | nz);
    const Vec3d n = glm::normalize(Vec3d(nx, ny, nz) / 127.5 - 1.);
    EXPECT_NEAR(opacityOf(volume(evenVoxels(100, 1, 1, 8), style.substr(0, style.size() - 1) + normals + " ] } }")),
                100 / 255. * (.3 + .6 * std::pow(1 - n.z, 2)), 1e-4);
}

// 41.4.5: the edge's colour where the normal is farther from the view than the threshold.
TEST(VolumeStyles, EdgesHaveTheirColour) {
    const auto of = [](int axis, const char* more) {
        return styled(volume(slopeVoxels(axis, 200, 4),
                             fmt::format("EdgeEnhancementVolumeStyle {{ edgeColor 1 0 0 1 {} }}", more)));
    };
    const double across = 1 - leftOfEight(200 / 255.);
    expectColor(of(0, ""), Vec3d(1, 0, 0) * across, 1e-4);
    expectColor(of(0, "gradientThreshold 1.6"), Vec3d(200 / 255.) * across, 1e-4);
    const Vec3f along = of(2, "");
    EXPECT_EQ(along.r, along.g);
    EXPECT_GT(along.g, .7);
}

// Between across and along the view: a mix by |n V|, of the edge's colour and the voxel's, on either side.
TEST(VolumeStyles, EdgesFadeIntoWhatTheyLieOn) {
    const auto byte = [](double x) { return int(std::lround((x + 1) / 2 * 255)); };
    const auto of = [&](double angle, double threshold, Integrator integrator) {
        return styled(
            volume("PixelTexture3D { image [ 1 1 1 1 255 ] }",
                   fmt::format("EdgeEnhancementVolumeStyle {{ edgeColor 1 0 0 1 gradientThreshold {} "
                               "surfaceNormals PixelTexture3D {{ image [ 3 1 1 1 {} ] }} }}",
                               threshold, byte(std::sin(angle)) << 16 | byte(0) << 8 | byte(std::cos(angle)))),
            integrator);
    };
    for (const double angle : {.3, .6435, 1.2, 1.5, kPi - .6435}) {
        const Vec3d n = glm::normalize(Vec3d(byte(std::sin(angle)), byte(0), byte(std::cos(angle))) / 127.5 - 1.);
        const double along = std::abs(n.z);
        for (const Integrator integrator : {Integrator::whitted, Integrator::path}) {
            expectColor(of(angle, .2, integrator), {1, along, along}, 1e-4);
            expectColor(of(angle, std::acos(along) + .05, integrator), {1, 1, 1}, 1e-4);
        }
    }
}

// 41.4.3: bands of equal angle, in HSV between the two.
TEST(VolumeStyles, CartoonsHaveBands) {
    const auto of = [](double angle, int steps) {
        const auto byte = [](double x) { return int(std::lround((x + 1) / 2 * 255)); };
        return styled(
            volume("PixelTexture3D { image [ 1 1 1 1 255 ] }",
                   fmt::format("CartoonVolumeStyle {{ orthogonalColor 1 0 0 1 parallelColor 0 1 0 1 colorSteps "
                               "{} surfaceNormals PixelTexture3D {{ image [ 3 1 1 1 {} ] }} }}",
                               steps, byte(std::sin(angle)) << 16 | 128 << 8 | byte(std::cos(angle)))));
    };
    const double quarter = kPi / 8;
    expectColor(of(.5 * quarter, 4), {1, 0, 0}, 1e-4);
    expectColor(of(1.5 * quarter, 4), {1, 2 / 3., 0}, 1e-4);
    expectColor(of(2.5 * quarter, 4), {2 / 3., 1, 0}, 1e-4);
    expectColor(of(3.5 * quarter, 4), {0, 1, 0}, 1e-4);
    expectColor(of(1.5, 1), {1, 0, 0}, 1e-4);                 // one colour alone: the orthogonal one
    expectColor(of(kPi - .5 * quarter, 4), {1, 0, 0}, 1e-4);  // from behind as from before
    EXPECT_EQ(styled(volume(evenVoxels(255, 2, 2, 2), "CartoonVolumeStyle { }")), Vec3f(0)) << "no surface is clear";
}

// 41.4.12: the sum over the lights of warm (1 + L n) / 2 and cool the rest; normals lead from dense to thin.
TEST(VolumeStyles, TonesGoFromWarmToCool) {
    const std::string style = "ToneMappedVolumeStyle { coolColor 0 0 1 0 warmColor 1 1 0 0 }";
    const auto tone = [&](double x, double z) {
        return styled(fmt::format("DirectionalLight {{ direction {} 0 {} }} ", -x, -z) +
                      volume(voxels(8, 1, 1, [](int i, int, int) { return 255 - 20 * i; }), style));
    };
    const double v = (255 - 70) / 255.;
    const auto expected = [&](double cosine) {
        return Vec3d(.5 + .5 * cosine, .5 + .5 * cosine, .5 - .5 * cosine) * v;
    };
    expectColor(tone(1, 0), expected(1), 1e-4);
    expectColor(tone(-1, 0), expected(-1), 1e-4);
    expectColor(tone(0, 1), expected(0), 1e-4);
    expectColor(tone(.6, .8), expected(.6), 1e-4);
}

// 41.4.10: 17.2.2 with the voxel's colour, or the material's.
TEST(VolumeStyles, ShadingIsThatOfMaterials) {
    const std::string texture = voxels(8, 1, 8, [](int i, int, int) { return 255 - 20 * i; });
    const double v = (255 - 70) / 255., cover = 1 - leftOfEight(v);
    const auto of = [&](const std::string& light, const std::string& fields) {
        return styled(light + volume(texture, "ShadedVolumeStyle { " + fields + " }"));
    };
    const std::string light = "DirectionalLight { direction -.6 0 -.8 intensity .5 ambientIntensity .4 } ";
    expectColor(of(light, ""), Vec3d(v * cover), 1e-4);
    expectColor(of(light, "lighting TRUE"), Vec3d(v * .6 * .5 * cover), 1e-4);
    const double clear = 1 - leftOfEight(v * .75);
    expectColor(of(light, "material Material { diffuseColor 1 .5 0 transparency .25 }"), Vec3d(1, .5, 0) * clear, 1e-4);
    expectColor(of(light,
                   "lighting TRUE material Material { diffuseColor 1 .5 0 ambientIntensity .2 emissiveColor 0 0 "
                   ".1 transparency .25 }"),
                (Vec3d(1, .5, 0) * (.6 * .5 + .4 * .2) + Vec3d(0, 0, .1)) * clear, 1e-4);
    const Vec3d l(.6, 0, .8), half = glm::normalize(l + Vec3d(0, 0, 1));
    // The normal lies across the view, so that either side faces it.
    const double shine = std::pow(std::abs(half.x), 128 * .1);
    expectColor(of(light, "lighting TRUE material Material { diffuseColor 0 0 0 specularColor 1 1 1 shininess .1 }"),
                Vec3d(shine * .5 * cover), 2e-3);
    // In the shadow of a wall: what the style says, not the light alone.
    const std::string wall =
        "Transform { translation 30 0 40 rotation 0 1 0 .6435 children " + square(9, unlit("1 1 1")) + " } ";
    expectColor(of(light + wall, "lighting TRUE"), Vec3d(v * .6 * .5 * cover), 1e-4);
    expectColor(
        of("DirectionalLight { direction -.6 0 -.8 intensity .5 shadows TRUE } " + wall, "lighting TRUE shadows TRUE"),
        Vec3d(0), 1e-4);
}

TEST(VolumeStyles, WhatIsBeyondALightsScopeThrowsNoShadow) {
    const std::string wall =
        "Transform { translation 30 0 40 rotation 0 1 0 .6435 children " + square(9, unlit("1 1 1")) + " } ";
    const auto of = [&](const std::string& within, const std::string& beyond) {
        return styled("Group { children [ DirectionalLight { direction -.6 0 -.8 shadows TRUE } " + within +
                      volume(evenVoxels(30, 1, 1, 8), "ShadedVolumeStyle { lighting TRUE shadows TRUE }") + " ] } " +
                      beyond);
    };
    EXPECT_EQ(of(wall, ""), Vec3f(0));
    EXPECT_GT(of("", "").r, 0);
    EXPECT_EQ(of("", wall), of("", ""));
    // Likewise of walls that may move, which have trees of their own, with one at rest beside them and without.
    const std::string moving = "DEF M " + wall;
    const std::string mover =
        " DEF P PositionInterpolator { key 0 keyValue 30 0 40 } ROUTE P.value_changed TO M.set_translation";
    const std::string resting = "Transform { translation 0 90 0 children " + square(1, unlit("1 1 1")) + " } ";
    for (const std::string& beside : {std::string(), resting}) {
        EXPECT_EQ(of(moving, beside + mover), Vec3f(0));
        EXPECT_EQ(of("", beside + moving + mover), of("", ""));
        EXPECT_EQ(of(beside, moving + mover), of("", ""));
    }
}

// A dense volume is dark where its own body hides the light.
TEST(VolumeStyles, ShadowsOfAVolumeFallOnItself) {
    const double v = 30 / 255.;
    const auto of = [&](const char* shadows) {
        return styled(std::string("DirectionalLight { direction 0 0 -1 shadows TRUE } ") +
                      volume(evenVoxels(30, 1, 1, 8),
                             fmt::format("ShadedVolumeStyle {{ lighting TRUE shadows {} }}", shadows)))
            .r;
    };
    EXPECT_NEAR(of("FALSE"), v * (1 - leftOfEight(v)), 1e-4);
    // The light comes as the eye looks, so each place is lit by what the eye sees of it: the integral of T^2.
    const double all = leftOfEight(v);
    EXPECT_NEAR(of("TRUE"), v * (1 - all * all) / 2, 1e-3);
}

// 41.4.8.
TEST(VolumeStyles, ProjectionsTakeOneValue) {
    const int values[] = {10, 60, 200, 120, 240, 90};
    const std::string texture =
        voxels(1, 1, 6, [&](int, int, int z) { return values[5 - z]; });  // as the eye meets them
    const auto of = [&](const char* fields) {
        return 255.0f *
               styled(volume(texture, fmt::format("ProjectionVolumeStyle {{ {} }}", fields)) + behind(3, "0 1 0"));
    };
    expectColor(of(""), Vec3d(240), 1e-3);
    expectColor(of("type \"MIN\""), Vec3d(10), 1e-3);
    expectColor(of("intensityThreshold .6"), Vec3d(200), 1e-3);  // the first above 153
    expectColor(of("intensityThreshold .85"), Vec3d(240), 1e-3);
    expectColor(of("type \"MIN\" intensityThreshold .3"), Vec3d(10), 1e-3);
    expectColor(of("type \"MIN\" intensityThreshold .02"), Vec3d(10), 1e-3);
    expectColor(of("type \"AVERAGE\""), Vec3d(720 / 6.), 1e-3);
    // On the slant values go by the square between two voxels: 0 on a quarter of the way, s^2 on half, 1 on a quarter.
    const std::string corner = voxels(2, 1, 2, [](int x, int, int z) { return x && z ? 255 : 0; });
    const std::string turned = "Transform { rotation 0 1 0 -.78539816 children ";
    expectColor(styled(turned + volume(corner, "ProjectionVolumeStyle { type \"AVERAGE\" }") + " }"), Vec3d(5 / 12.),
                1e-4);
    expectColor(styled(turned + volume(corner, "ProjectionVolumeStyle { }") + " }"), Vec3d(1), 1e-4);
    // Of the remaining part.
    expectColor(styled("Group { children [ ClipPlane { plane 0 0 1 0 } " +
                       volume(texture, "ProjectionVolumeStyle { }") + " ] }"),
                Vec3d(200 / 255.), 1e-4);
    // The alpha is the voxels' own.
    expectColor(styled(volume("PixelTexture3D { image [ 2 1 1 2 0x6640 0x6640 ] }", "ProjectionVolumeStyle { }") +
                       behind(3, "0 1 0")),
                Vec3d(.4 * 64 / 255) + Vec3d(0, 1 - 64 / 255., 0), 1e-4);
    // Up to a surface within.
    EXPECT_LT(255 * styled(volume(texture, "ProjectionVolumeStyle { }") + behind(0, "0 1 0")).r, 202);
}

TEST(VolumeStyles, StylesFollowEachOther) {
    const double v = 100 / 255.;
    const std::string two =
        "ComposedVolumeStyle { renderStyle [ " + opacityMap("1 1 4 0xFF800040") +
        " SilhouetteEnhancementVolumeStyle { silhouetteRetainedOpacity .5 silhouetteBoundaryOpacity 0 } ] }";
    const double cover = 1 - leftOfEight(.5 * 64 / 255);
    expectColor(styled(volume(evenVoxels(100, 1, 1, 8), two)), Vec3d(1, 128 / 255., 0) * cover, 1e-4);
    const std::string off =
        "ComposedVolumeStyle { renderStyle [ OpacityMapVolumeStyle { enabled FALSE transferFunction "
        "PixelTexture { image 1 1 4 0xFF000040 } } ] }";
    expectColor(styled(volume(evenVoxels(100, 1, 1, 8), off)), Vec3d(v * (1 - leftOfEight(v))), 1e-4);
    expectColor(styled(volume(evenVoxels(100, 1, 1, 8), "OpacityMapVolumeStyle { enabled FALSE }")), Vec3d(0), 0);
}

// 41.4.1: C = C1 w1 + C2 w2, O likewise.
TEST(VolumeStyles, TwoVolumesAreBlended) {
    const double a = 51 / 255., b = 153 / 255.;
    const auto of = [&](const std::string& weights) {
        return styled(volume(evenVoxels(51, 1, 1, 8),
                             "BlendedVolumeStyle { voxels " + evenVoxels(153, 1, 1, 8) + weights + " }"));
    };
    const auto expected = [&](double first, double second) {
        const double w = std::min(a * first + b * second, 1.);
        return Vec3d(w * (1 - leftOfEight(w)));
    };
    expectColor(of(""), expected(.5, .5), 3e-4);
    expectColor(of(" weightConstant1 .25 weightConstant2 1"), expected(.25, 1), 3e-4);
    expectColor(of(" weightFunction1 \"ALPHA1\" weightFunction2 \"ALPHA2\""), expected(a, b), 3e-4);
    expectColor(of(" weightFunction1 \"ONE_MINUS_ALPHA2\" weightFunction2 \"ONE_MINUS_ALPHA1\""),
                expected(1 - b, 1 - a), 3e-4);
    expectColor(
        of(" weightFunction1 \"TABLE\" weightTransferFunction1 PixelTexture { image 1 1 1 102 } weightConstant2 0"),
        expected(.4, 0), 3e-4);
    expectColor(of(" weightConstant1 0 weightConstant2 1 renderStyle " + opacityMap("1 1 4 0x00FF0033")),
                Vec3d(0, 1, 0) * (1 - leftOfEight(.2)), 3e-4);
}

// 41.4.9.
TEST(VolumeStyles, SegmentsHaveStylesOfTheirOwn) {
    const auto of = [](const char* ids, const std::string& more) {
        return styled("SegmentedVolumeData { dimensions 2 2 2 voxels " + evenVoxels(51, 1, 1, 2) +
                      " segmentIdentifiers PixelTexture3D { image [ 1 1 1 2 " + ids + " ] } renderStyle [ " +
                      opacityMap("1 1 4 0xFF000033") + " " + opacityMap("1 1 4 0x00FF0099") + " ] " + more + " }");
    };
    // The second voxel is the one in front.
    expectColor(of("0 0", ""), Vec3d(1, 0, 0) * (1 - .8 * .8), 1e-4);
    expectColor(of("1 1", ""), Vec3d(0, 1, 0) * (1 - .4 * .4), 1e-4);
    expectColor(of("0 1", ""), {.4 * .2, .6, 0}, 1e-4);
    expectColor(of("1 0", ""), {.2, .8 * .6, 0}, 1e-4);
    expectColor(of("0 1", "segmentEnabled [ TRUE FALSE ]"), {.2, 0, 0}, 1e-4);
    expectColor(of("0 1", "segmentEnabled [ FALSE ]"), {0, .6, 0}, 1e-4);
    expectColor(of("7 7", ""), Vec3d(0, 1, 0) * (1 - .4 * .4), 1e-4);  // the last style is that of all beyond
}

/// f = 1/2 + (R - r) k in a box 2 m wide.
std::string ballVoxels(int n, double radius, double k) {
    return voxels(n, n, n, [&](int x, int y, int z) {
        const Vec3d p = (Vec3d(x, y, z) + .5) * (2. / n) - 1.;
        return int(std::lround(255 * std::clamp(.5 + (radius - glm::length(p)) * k, 0., 1.)));
    });
}
std::string surfacesOf(const std::string& texture, const std::string& more) {
    return "IsoSurfaceVolumeData { dimensions 2 2 2 voxels " + texture + " " + more + " }\n";
}

// Where a ray meets the ball, told by a fog that is linear in the distance; and its normal, by a light along the view.
TEST(VolumeSurfaces, OfADistanceAreTheBall) {
    const double radius = .6, k = .8, pixel = 1.6 / 32;
    const std::string ball = ballVoxels(40, radius, k), eye = "OrthoViewpoint { fieldOfView [ -.8 -.8 .8 .8 ] } ";
    LightScene depth(eye + "Fog { color 0 0 0 visibilityRange 20 } " +
                         surfacesOf(ball, "surfaceValues .5 renderStyle " + opacityMap("1 1 4 0xFFFFFFFF")),
                     32, 32);
    LightScene facing(eye + "DirectionalLight { } " +
                          surfacesOf(ball, "surfaceValues .5 renderStyle ShadedVolumeStyle { lighting TRUE }"),
                      32, 32);
    const Picture far = depth.picture(), lit = facing.picture();
    int compared = 0;
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x) {
            const double px = (x + .5 - 16) * pixel, py = (y + .5 - 16) * pixel, r = std::hypot(px, py);
            if (r > radius + .02) {
                EXPECT_EQ(far.at(x, y).r, 0) << x << " " << y;
            }
            if (r > .9 * radius) continue;
            const double z = std::sqrt(radius * radius - r * r), distance = 10 - z;
            // A byte is 1 / (255 k) = 5 mm, a voxel 50 mm.
            EXPECT_NEAR(20 * (1 - far.at(x, y).r), distance, .008) << x << " " << y;
            EXPECT_NEAR(lit.at(x, y).r / .5, z / radius, .06) << x << " " << y;
            ++compared;
        }
    EXPECT_GT(compared, 250);
}

TEST(VolumeSurfaces, AreSeenThroughEachOther) {
    // Values rise from front to back.
    const std::string ramp = voxels(1, 1, 16, [](int, int, int z) { return 255 - 16 * z; });
    const std::string styles = "renderStyle [ " + opacityMap("1 1 4 0xFF000033") + " " +
                               opacityMap("1 1 4 0x00FF0080") + " " + opacityMap("1 1 4 0x0000FFFF") + " ]";
    const double g = 128 / 255.;
    expectColor(styled(surfacesOf(ramp, "surfaceValues [ .25 .5 .75 ] " + styles)), {.2, .8 * g, .8 * (1 - g)}, 1e-4);
    expectColor(styled(surfacesOf(ramp, "surfaceValues [ .75 .5 .25 ] " + styles)), {0, 0, 1}, 1e-4);
    // Two in one step are met in their order, from either side.
    const std::string close = "surfaceValues [ .5 .505 ] renderStyle [ " + opacityMap("1 1 4 0xFF0000FF") + " " +
                              opacityMap("1 1 4 0x00FF00FF") + " ]";
    expectColor(styled(surfacesOf(ramp, close)), {1, 0, 0}, 0);
    expectColor(styled("Transform { rotation 0 1 0 3.14159265 children " + surfacesOf(ramp, close) + " }"), {0, 1, 0},
                0);
    // One value and a step: .15, .4, .65, .9; the value given has the first style, the others from the lowest on.
    expectColor(styled(surfacesOf(ramp, "surfaceValues .4 contourStepSize .25 " + styles)),
                {.2 * (1 - g), g, .8 * (1 - g)}, 1e-4);
    expectColor(styled(surfacesOf(ramp, "surfaceValues .4 contourStepSize -.25 " + styles)),
                {.2 * (1 - g), g, .8 * (1 - g)}, 1e-4);
    // Without a style: opaque, of the value's grey.
    expectColor(styled(surfacesOf(ramp, "surfaceValues .6")), Vec3d(.6), 1e-5);
    expectColor(styled(surfacesOf(ramp, "surfaceValues .6"), Integrator::path), Vec3d(linearFromSrgb(.6f)), 1e-5);
    // Where values change by less than the tolerance from voxel to voxel there is none.
    expectColor(styled(surfacesOf(ramp, "surfaceValues .6 surfaceTolerance .05")), Vec3d(.6), 1e-5);
    expectColor(styled(surfacesOf(ramp, "surfaceValues .6 surfaceTolerance .07")), Vec3d(0), 0);
    expectColor(styled(surfacesOf(ramp, "surfaceValues 7")), Vec3d(0), 0);
    // A convex one throws no shadow on its lit side.
    const std::string ball = ballVoxels(20, .6, .8), lit = "DirectionalLight { direction -.3 -.2 -1 shadows TRUE } ";
    const auto shaded = [&](const char* shadows) {
        return styled(lit +
                      surfacesOf(ball, fmt::format("surfaceValues .5 renderStyle ShadedVolumeStyle {{ lighting TRUE "
                                                   "shadows {} }}",
                                                   shadows)));
    };
    expectColor(shaded("TRUE"), Vec3d(shaded("FALSE")), 0);
    EXPECT_GT(shaded("TRUE").r, .4);
}

TEST(VolumeSurfaces, WhatCannotBeIsNamed) {
    LightScene s("DEF I IsoSurfaceVolumeData { voxels " + evenVoxels(9, 2, 2, 2) +
                 " surfaceValues .5 gradients PixelTexture3D { image [ 3 1 1 1 0 ] } renderStyle ProjectionVolumeStyle "
                 "{ } } DEF V "
                 "VolumeData { voxels " +
                 evenVoxels(9, 2, 2, 2) + " renderStyle ShadedVolumeStyle { phaseFunction \"FOG\" } }");
    s.center();
    std::string all;
    for (const Diagnostic& d : s.light->diagnostics().all()) all += d.text + "\n";
    EXPECT_EQ(
        all,
        "IsoSurfaceVolumeData I has gradients of another size than its voxels, or of less than 3 components: they "
        "are not used\nIsoSurfaceVolumeData I has a ProjectionVolumeStyle for a part of it, which is drawn without "
        "a style\nVolumeData V has a phaseFunction \"FOG\", which is neither Henyey-Greenstein nor NONE\n");
}

}  // namespace
}  // namespace rtsg
