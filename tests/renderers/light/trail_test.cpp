// Pictures that follow each other: what is taken from the last one is what tracing anew gives, bit for bit, and what
// cannot have changed is not traced.
#include "packet/trail.h"

#include <random>

#include <rtsg/core/x3d.h>

#include "light_scene.h"
#include "support/plain_film.h"

namespace rtsg {
namespace {

using namespace test;

/// A floor, a mirror and a glass ball, lights of three kinds and things that move.
std::string roomWithItems() {
    std::string body =
        "DEF SKY Background { skyColor .2 .3 .5 } DEF NAV NavigationInfo { headlight FALSE } DEF EYE Viewpoint { "
        "position 0 3 12 } "
        "DEF SUN DirectionalLight { direction 1 -2 -1 intensity .4 shadows TRUE } "
        "DEF LAMP PointLight { location -4 6 3 intensity .5 shadows TRUE } "
        "DEF SPOT SpotLight { location 5 5 5 direction -1 -1 -1 intensity .5 radius 40 cutOffAngle .4 shadows TRUE } "
        "Transform { translation 0 -2 0 children Shape { appearance Appearance { material Material { } } geometry Box "
        "{ size 16 .1 16 } } } "
        "Transform { translation 3 1 -3 children Shape { appearance Appearance { " +
        mirror(".8") +
        " } geometry Box { size 4 4 .2 } } } "
        "Transform { translation -2 1 2 children Shape { appearance Appearance { " +
        glass(1.5) + " } geometry Sphere { radius 1 } } }";
    for (int i = 0; i < 6; ++i)
        body += fmt::format(
            "DEF T{0} Transform {{ translation {1} {2} {3} scale .4 .4 .4 children DEF S{0} Shape {{ appearance DEF "
            "A{0} Appearance {{ material DEF M{0} Material {{ }} }} geometry {4} }} }} ",
            i, -5 + 2 * i, -1.3 + .5 * i, i % 3 - 2, i % 2 ? "Sphere { }" : "Box { }");
    return body;
}

Picture next(LightScene& s) {
    auto picture = s.light->nextPicture(s.options, &s.stats);
    if (!picture) {
        ADD_FAILURE() << picture.error().format();
        return Picture(s.options.settings.width, s.options.settings.height);
    }
    return std::move(*picture);
}
/// The next one is what another, made without the last, is.
void expectAsTracedAnew(LightScene& s, const std::string& what) {
    const Picture kept = next(s);
    const RenderStats stats = s.stats;
    const Picture anew = s.picture();
    EXPECT_EQ(s.stats.kept, 0);
    EXPECT_EQ(kept.pixels, anew.pixels) << what;
    EXPECT_EQ(kept.space, anew.space);
    EXPECT_EQ(stats.samples, s.stats.samples);
    EXPECT_EQ(stats.missingMaximum, s.stats.missingMaximum);
    s.stats = stats;
}

TEST(Trail, AStillSceneTracesNothing) {
    LightScene s(roomWithItems(), 60, 40);
    for (const Integrator integrator : {Integrator::whitted, Integrator::path})
        for (const float error : {0.0f, .3f}) {
            s.options.settings.integrator = integrator;
            s.options.settings.samplesPerPixel = error > 0 ? 32 : 2;
            s.options.settings.error = error;
            const Picture first = next(s);
            EXPECT_EQ(s.stats.kept, 0);
            EXPECT_GT(s.stats.primaryRays, 0);
            const double reached = s.stats.error, samples = s.stats.samples;
            s.scene.newFrame(s.scene.now() + 1);
            const Picture second = next(s);
            EXPECT_EQ(s.stats.kept, 1);
            EXPECT_EQ(s.stats.primaryRays + s.stats.shadowRays + s.stats.secondaryRays, 0);
            EXPECT_EQ(s.stats.error, reached);
            EXPECT_EQ(s.stats.samples, samples);
            EXPECT_EQ(first.pixels, second.pixels);
            EXPECT_EQ(first.interval, second.interval);
        }
}

TEST(Trail, WhatIsKeptIsWhatWouldBeTraced) {
    const std::uint64_t seed = 20261125;
    SCOPED_TRACE(seed);
    std::mt19937_64 random(seed);
    const auto unit = [&] { return static_cast<float>(random() % 1001) / 1000; };
    LightScene s(roomWithItems(), 100, 70);
    next(s);
    double kept = 0;
    int rounds = 0;
    for (int round = 0; round < 120; ++round) {
        const int i = static_cast<int>(random() % 6);
        const auto named = [&](const char* kind) { return s.node(fmt::format("{}{}", kind, i).c_str()); };
        const auto kind = random() % 9;
        switch (kind) {
            case 0:
            case 1:
            case 2:
            case 3:
                ASSERT_TRUE(s.scene.set(named("T"), x3d::Transform::translation,
                                        Vec3f(unit() * 10 - 5, unit() * 5 - 1.5f, unit() * 10 - 7)));
                break;
            case 4:
                ASSERT_TRUE(s.scene.set(named("M"), x3d::Material::diffuseColor, Color{unit(), unit(), unit()}));
                break;
            case 5:
                ASSERT_TRUE(s.scene.set(named("M"), x3d::Material::transparency, unit() < .5f ? 0.0f : .6f));
                break;
            case 6:
                ASSERT_TRUE(s.scene.set(named("S"), x3d::Shape::castShadow, unit() < .5f));
                break;
            case 7:
                ASSERT_TRUE(s.scene.set(named("T"), x3d::Transform::visible, unit() < .5f));
                break;
            default:
                if (unit() < .5f) {
                    ASSERT_TRUE(s.scene.set(s.node("LAMP"), x3d::PointLight::location, Vec3f(-4, 6, unit())));
                    ASSERT_TRUE(s.scene.set(s.node("SPOT"), x3d::SpotLight::cutOffAngle, .5f * unit()));
                } else {
                    ASSERT_TRUE(s.scene.set(s.node("EYE"), x3d::Viewpoint::position, Vec3f(unit(), 3, 12)));
                }
        }
        s.scene.newFrame(round + 1);
        s.options.settings.samplesPerPixel = round < 100 ? 1 : 3;
        expectAsTracedAnew(s, fmt::format("round {}, edit {}", round, kind));
        kept += s.stats.kept, ++rounds;
    }
    EXPECT_GT(kept / rounds, .3) << "or nothing was tested";
    EXPECT_LT(kept / rounds, .95);
}

/// The share of the picture that is kept when T0 goes from one place to another.
double keptAfterMove(LightScene& s, const Vec3f& from, const Vec3f& to) {
    EXPECT_TRUE(s.scene.set(s.node("T0"), x3d::Transform::translation, from));
    s.scene.newFrame(s.scene.now() + 1);
    next(s);
    EXPECT_TRUE(s.scene.set(s.node("T0"), x3d::Transform::translation, to));
    s.scene.newFrame(s.scene.now() + 1);
    expectAsTracedAnew(s, "a move");
    return s.stats.kept;
}

const char* const kWall =
    "DEF LAMP PointLight { location 0 2 9 shadows TRUE } "
    "Transform { translation 0 0 -5 children Shape { appearance Appearance { material Material { } } geometry Box { "
    "size 200 200 1 } } } "
    "DEF T0 Transform { children Shape { appearance Appearance { material Material { } } geometry Box { size .2 .2 .2 "
    "} } } ";

TEST(Trail, OnlyTilesThatItOrItsShadowCrossesAreTraced) {
    LightScene s(kWall, 160, 160);
    EXPECT_EQ(keptAfterMove(s, {0, 0, -20}, {1, 0, -20}), 1) << "behind the wall";
    EXPECT_EQ(keptAfterMove(s, {0, 0, 20}, {1, 0, 20}), 1) << "behind eye and lamp";
    const double seen = keptAfterMove(s, {-.1f, 0, 0}, {.1f, 0, 0});
    EXPECT_GT(seen, .7);
    EXPECT_LT(seen, 1);
    // Above the picture, between the lamp and what is in it.
    const double shadow = keptAfterMove(s, {0, 1.8f, 8}, {.1f, 1.8f, 8});
    const double aside = keptAfterMove(s, {0, 30, 8}, {.1f, 30, 8});
    EXPECT_LT(shadow, 1);
    EXPECT_EQ(aside, 1);
}

TEST(Trail, WhatAMirrorOrGlassShowsIsTracedAgain) {
    for (const std::string& surface : {mirror(".9"), glass(1.4)}) {
        LightScene s(
            "Background { skyColor .1 .2 .3 } DirectionalLight { shadows FALSE } Transform { translation 0 0 -5 "
            "children Shape { appearance Appearance { " +
                surface +
                " } geometry Box { size 3 3 .5 } } } DEF T0 Transform { children Shape { appearance "
                "Appearance { material Material { } } geometry Box { size 2 2 2 } } } ",
            96, 96);
        const bool isMirror = surface == mirror(".9");
        const double behind = keptAfterMove(s, {0, 0, -15}, {1, 0, -15});
        const double inFront = keptAfterMove(s, {0, 0, 25}, {1, 0, 25});
        EXPECT_LT(isMirror ? inFront : behind, 1);
        EXPECT_GT(isMirror ? inFront : behind, .3) << "beside it nothing changes";
    }
}

TEST(Trail, OnlyWhatALampShinesOnIsTracedAgain) {
    LightScene s(
        "DEF LAMP SpotLight { location -2 0 5 direction 0 0 -1 cutOffAngle .2 beamWidth .1 shadows TRUE } "
        "DEF BALL PointLight { location 2 0 1 radius 2 intensity .5 } DEF OFF PointLight { on FALSE } "
        "Shape { appearance Appearance { material Material { } } geometry Box { size 20 20 1 } }",
        160, 160);
    next(s);
    const auto fraction = [&](const char* what) {
        s.scene.newFrame(s.scene.now() + 1);
        expectAsTracedAnew(s, what);
        return s.stats.kept;
    };
    ASSERT_TRUE(s.scene.set(s.node("LAMP"), x3d::SpotLight::location, Vec3f(-2, .2f, 5)));
    const double spot = fraction("a cone moves");
    EXPECT_GT(spot, .7);
    EXPECT_LT(spot, 1);
    ASSERT_TRUE(s.scene.set(s.node("LAMP"), x3d::SpotLight::direction, Vec3f(.3f, 0, -1)));
    EXPECT_LT(fraction("a cone turns"), spot);
    ASSERT_TRUE(s.scene.set(s.node("BALL"), x3d::PointLight::color, Color{1, 0, 0}));
    const double ball = fraction("a ball is red");
    EXPECT_GT(ball, .5);
    EXPECT_LT(ball, 1);
    ASSERT_TRUE(s.scene.set(s.node("BALL"), x3d::PointLight::radius, 3.0f));
    EXPECT_LT(fraction("it grows"), ball);
    ASSERT_TRUE(s.scene.set(s.node("OFF"), x3d::PointLight::color, Color{1, 0, 0}));
    EXPECT_EQ(fraction("one that is off"), 1);
    ASSERT_TRUE(s.scene.set(s.node("OFF"), x3d::PointLight::on, true));
    EXPECT_EQ(fraction("it is on"), 0);
    ASSERT_TRUE(s.scene.set(s.node("BALL"), x3d::PointLight::radius, -1.0f));
    fraction("no end");
}

TEST(Trail, WhatCastsNoShadowInALightLeavesItsPixels) {
    // The lamp's scope is a group; a thing goes through its light beside the group, and one within it.
    LightScene s(
        "Viewpoint { position 0 0 12 } NavigationInfo { headlight FALSE } Group { children [ DEF LAMP PointLight { "
        "location 3 2 9 global FALSE shadows TRUE } Transform { translation 0 0 -5 children Shape { appearance "
        "Appearance { material Material { } } geometry Box { size 200 200 1 } } } DEF T1 Transform { translation 1 1 0 "
        "children DEF SHAPE Shape { appearance Appearance { material Material { } } geometry Box { size .5 .5 .5 } } } "
        "] } DEF T0 Transform { children USE SHAPE }",
        90, 60);
    next(s);
    for (const char* moved : {"T0", "T1", "T0", "T1"})
        for (const Vec3f& to : {Vec3f(1, 1.5f, 3), Vec3f(-2, 0, 1)}) {
            ASSERT_TRUE(s.scene.set(s.node(moved), x3d::Transform::translation, to));
            s.scene.newFrame(s.scene.now() + 1);
            expectAsTracedAnew(s, moved);
        }
    ASSERT_TRUE(s.scene.set(s.node("LAMP"), x3d::PointLight::global, true));
    s.scene.newFrame(s.scene.now() + 1);
    expectAsTracedAnew(s, "the lamp shines everywhere");
}

TEST(Trail, AConeMeetsABoxWhereItShinesOnIt) {
    const trace::LightReach cone{{1, 2, 3}, {0, 0, -1}, 10, .3f};
    std::mt19937 random(7);
    std::uniform_real_distribution<float> number(-12, 12), size(0, 3);
    int met = 0, apart = 0;
    for (int i = 0; i < 20000; ++i) {
        Bounds box;
        box.min = Vec3f(number(random), number(random), number(random));
        box.max = box.min + Vec3f(size(random), size(random), size(random));
        bool lit = false;
        for (int k = 0; k < 60 && !lit; ++k) {
            const Vec3f p = box.min + box.size() * Vec3f(size(random), size(random), size(random)) / 3.0f;
            const Vec3f to = p - cone.apex;
            lit = glm::length(to) <= 10 && -to.z >= glm::length(to) * std::cos(.3f);
        }
        if (lit) {
            ASSERT_TRUE(cone.meets(box)) << i;
            ++met;
        }
        apart += !cone.meets(box);
    }
    EXPECT_GT(met, 200);
    EXPECT_GT(apart, 15000) << "a ball around a box is not much more than the box";
}

TEST(Trail, WhatNoBoxIsAroundChangesEverything) {
    LightScene s(roomWithItems(), 64, 48);
    next(s);
    const auto changed = [&](const char* what) {
        s.scene.newFrame(s.scene.now() + 1);
        expectAsTracedAnew(s, what);
        EXPECT_EQ(s.stats.kept, 0) << what;
    };
    ASSERT_TRUE(s.scene.set(s.node("SKY"), x3d::Background::skyColor, Array<Color>{Color{.5f, 0, 0}}));
    changed("sky");
    ASSERT_TRUE(s.scene.set(s.node("SUN"), x3d::DirectionalLight::intensity, .7f));
    changed("light");
    ASSERT_TRUE(s.scene.set(s.node("NAV"), x3d::NavigationInfo::headlight, true));
    changed("headlight");
    ASSERT_TRUE(s.scene.set(s.node("EYE"), x3d::Viewpoint::position, Vec3f(0, 3, 13)));
    changed("eye");
    s.options.settings.seed = 5;
    changed("settings");
    s.options.settings.width = 48;
    changed("size");
    s.options.keep = false;
    changed("not asked for");
    s.options.keep = true;
    const Picture shown = next(s);
    s.scene.newFrame(s.scene.now() + 1);
    EXPECT_EQ(next(s).pixels, shown.pixels);
    EXPECT_EQ(s.stats.kept, 1);
}

TEST(Trail, LinesAreWiderThanTheirBoxes) {
    LightScene s(
        std::string(kWall) +
            "DEF T1 Transform { translation 0 0 1 children Shape { appearance Appearance { material UnlitMaterial "
            "{ } lineProperties LineProperties { linewidthScaleFactor 9 } } geometry LineSet { vertexCount 2 "
            "coord Coordinate { point [ -1 0 0, 1 0 0 ] } } } }",
        80, 80);
    next(s);
    ASSERT_TRUE(s.scene.set(s.node("T1"), x3d::Transform::translation, Vec3f(0, .1f, 1)));
    s.scene.newFrame(1);
    expectAsTracedAnew(s, "a line");
    EXPECT_EQ(s.stats.kept, 0);
    ASSERT_TRUE(s.scene.set(s.node("T0"), x3d::Transform::translation, Vec3f(.5f, 1, 0)));
    s.scene.newFrame(2);
    expectAsTracedAnew(s, "a box beside it");
    EXPECT_GT(s.stats.kept, .5);
}

TEST(Trail, EachLayerAndEachEyeHasItsOwn) {
    LightScene layers(
        "LayerSet { order [0 1] layers Layer { viewport Viewport { clipBoundary [0 .5 0 1] } children [ DEF V "
        "Viewpoint "
        "{ } DEF T1 Transform { children Shape { geometry Box { } appearance Appearance { material Material { } } } } "
        "] "
        "} } Shape { geometry Sphere { } }",
        64, 64);
    next(layers);
    ASSERT_TRUE(layers.scene.set(layers.node("T1"), x3d::Transform::translation, Vec3f(1, 0, 0)));
    layers.scene.newFrame(1);
    expectAsTracedAnew(layers, "in a layer");
    EXPECT_GT(layers.stats.kept, .5);
    EXPECT_LT(layers.stats.kept, 1.5);
    layers.scene.newFrame(2);
    expectAsTracedAnew(layers, "layers at rest");
    EXPECT_EQ(layers.stats.primaryRays, 0);

    LightScene s(kWall, 64, 64);
    s.options.stereo = Stereo::beside;
    next(s);
    ASSERT_TRUE(s.scene.set(s.node("T0"), x3d::Transform::translation, Vec3f(.5f, 1, 0)));
    s.scene.newFrame(1);
    expectAsTracedAnew(s, "two eyes");
    EXPECT_GT(s.stats.kept, .3);
    EXPECT_LT(s.stats.kept, 1);
    s.scene.newFrame(2);
    expectAsTracedAnew(s, "two eyes at rest");
    EXPECT_EQ(s.stats.kept, 1);
}

TEST(Trail, ACancelledPictureIsNothingToGoOnFrom) {
    LightScene s(roomWithItems(), 160, 120);
    s.options.settings.progress = [](double) { return false; };
    next(s);
    ASSERT_TRUE(s.stats.cancelled);
    s.options.settings.progress = {};
    expectAsTracedAnew(s, "after a cancelled one");
    EXPECT_EQ(s.stats.kept, 0);
}

// Versions of a world share the pages of their tables that are the same; what changed may be on any.
TEST(Trail, OneOfManyIsFoundWhereverItIs) {
    constexpr int kSide = 14;
    std::string body = "OrthoViewpoint { fieldOfView [ -7 -7 7 7 ] } ";
    for (int i = 0; i < kSide * kSide; ++i)
        body += fmt::format(
            "DEF T{} Transform {{ translation {} {} 0 children Shape {{ appearance DEF A{} Appearance {{ "
            "material DEF M{} UnlitMaterial {{ }} }} geometry Box {{ size .4 .4 .4 }} }} }} ",
            i, i % kSide - 6.5, i / kSide - 6.5, i, i);
    LightScene s(body, 224, 224);
    next(s);
    for (const int i : {0, 31, 32, 70, 130, kSide * kSide - 1}) {
        ASSERT_TRUE(
            s.scene.set(s.node(fmt::format("M{}", i).c_str()), x3d::UnlitMaterial::emissiveColor, Color{1, 0, 0}));
        s.scene.newFrame(s.scene.now() + 1);
        expectAsTracedAnew(s, fmt::format("colour of {}", i));
        EXPECT_LT(s.stats.kept, 1) << i;
        EXPECT_GT(s.stats.kept, .9) << i;
        const Vec3f at(static_cast<float>(i % kSide) - 6.4f, static_cast<float>(i / kSide) - 6.4f, 0);
        ASSERT_TRUE(s.scene.set(s.node(fmt::format("T{}", i).c_str()), x3d::Transform::translation, at));
        s.scene.newFrame(s.scene.now() + 1);
        expectAsTracedAnew(s, fmt::format("place of {}", i));
        EXPECT_LT(s.stats.kept, 1) << i;
        EXPECT_GT(s.stats.kept, .9) << i;
    }
}

// Shapes that move together become one body for rays, and resting shapes are merged meanwhile.
TEST(Trail, BodiesThatMoveAndRestAreFollowed) {
    std::string parts;
    for (int i = 0; i < 5; ++i)
        parts += fmt::format(
            "Transform {{ translation {} {} 0 children {} }} ", .5 * i - 1, .3 * (i % 2),
            i == 0 ? "DEF PART Shape { appearance Appearance { material Material { } } geometry Box { size .4 .4 .4 } }"
                   : "USE PART");
    LightScene s(std::string(kWall) + "DEF CAR Transform { translation 0 1 2 children [ " + parts + " ] } DEF TOP " +
                     "Transform { translation 2 -1 1 children Transform { rotation 0 1 0 .5 children USE PART } }",
                 96, 96);
    next(s);
    double kept = 0;
    constexpr int kFrames = 400;
    for (int frame = 1; frame <= kFrames; ++frame) {
        const float t = static_cast<float>(frame) * .05f;
        if (frame % 100 < 60) {
            ASSERT_TRUE(s.scene.set(s.node("CAR"), x3d::Transform::translation, Vec3f(std::sin(t), 1, 2)));
        }
        if (frame % 50 == 0) {
            ASSERT_TRUE(s.scene.set(s.node("TOP"), x3d::Transform::rotation, Rotation{0, 0, 1, t}));
        }
        s.scene.newFrame(frame);
        expectAsTracedAnew(s, fmt::format("frame {}", frame));
        if (testing::Test::HasFailure()) return;
        kept += s.stats.kept / kFrames;
    }
    EXPECT_GT(kept, .6);
    EXPECT_LT(kept, .99);
}

TEST(Trail, AFilmThatPlaysIsDrawn) {
    LightScene s(
        "Shape { appearance Appearance { material UnlitMaterial { } texture DEF M MovieTexture { startTime 1 "
        "loop TRUE url \"" +
            test::dataUrl("video/avi", test::plainFilm(8, 10)) +
            "\" } } geometry Box { } } Transform { translation 3 0 0 children Shape { geometry Box { } } }",
        64, 48);
    if (!s.light->diagnostics().all().empty()) GTEST_SKIP() << s.light->diagnostics().all()[0].text;
    ASSERT_TRUE(s.scene.set(s.node("M"), x3d::MovieTexture::_duration, Time{.8}));
    next(s);
    int changed = 0;
    for (int frame = 1; frame <= 20; ++frame) {
        s.scene.newFrame(1 + frame * .05);
        expectAsTracedAnew(s, fmt::format("frame {}", frame));
        EXPECT_GT(s.stats.kept, .3) << "beside it nothing changes";
        changed += s.stats.kept < 1;
    }
    EXPECT_GE(changed, 8);
}

TEST(Trail, StatesOnOtherThreadsAreKeptToo) {
    LightScene s(roomWithItems(), 64, 48);
    LightRenderer::Options options;
    options.image = s.options;
    LightRenderer there(*s.world, options);
    const auto draw = [&] {
        auto state = there.prepare();
        ASSERT_TRUE(state);
        ASSERT_TRUE(there.renderFrame(**state));
        EXPECT_EQ(there.frame().pixels, s.picture().pixels);
    };
    draw();
    EXPECT_EQ(there.stats().kept, 0);
    s.scene.newFrame(1);
    draw();
    EXPECT_EQ(there.stats().kept, 1);
    ASSERT_TRUE(s.scene.set(s.node("T0"), x3d::Transform::translation, Vec3f(.5f, 1, 0)));
    s.scene.newFrame(2);
    draw();
    EXPECT_GT(there.stats().kept, .1);
    EXPECT_LT(there.stats().kept, 1);
}

TEST(Trail, ManyChangesAreTakenTogether) {
    trace::Differences many;
    for (int i = 0; i < 300; ++i)
        many.boxes.push_back({{Vec3f(static_cast<float>(i)), Vec3f(static_cast<float>(i + 1))}, i == 77});
    std::vector<trace::TraceLight> lights(60);
    const auto boxes = [&] { return trace::Untouched(many, lights).boxes(); };
    EXPECT_EQ(boxes().size(), 38u) << "lights without shadows cost nothing";
    for (trace::TraceLight& light : lights) light.shadows = true;
    const auto few = boxes();
    ASSERT_EQ(few.size(), 5u);
    Bounds all;
    int casting = 0;
    for (const trace::Differences::Box& box : few) {
        all.extend(box.around.min), all.extend(box.around.max);
        casting += box.castsShadow;
        if (box.castsShadow) {
            EXPECT_LE(box.around.min.x, 77);
            EXPECT_GE(box.around.max.x, 78);
        }
    }
    EXPECT_EQ(casting, 1);
    EXPECT_NEAR(all.min.x, 0, .01f);
    EXPECT_NEAR(all.max.x, 300, .01f);
}

// A still picture by paths goes on adding samples where that is asked for, and says how many it has; what changes
// begins anew.
TEST(Trail, PicturesByPathsAreRefined) {
    LightScene s(
        "Background { skyColor .5 .5 .5 } Shape { appearance Appearance { material DEF M Material { diffuseColor .8 .6 "
        ".4 } } geometry Box { size 9 .1 9 } } Transform { translation 0 1 0 children Shape { appearance Appearance { "
        "material Material { diffuseColor .9 .9 .9 } } geometry Sphere { } } } "
        "Viewpoint { position 0 1 4 } DirectionalLight { direction -1 -1 -2 }",
        16, 16);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.samplesPerPixel = 2048;
    const Picture truth = s.picture();
    const auto error = [&](const Picture& p) {
        double sum = 0;
        for (std::size_t i = 0; i < p.pixels.size(); ++i) sum += std::pow(p.pixels[i].r - truth.pixels[i].r, 2);
        return std::sqrt(sum / static_cast<double>(p.pixels.size()));
    };
    s.options.settings.samplesPerPixel = 4;
    s.options.refine = true;
    s.options.settings.layers = kDepth;
    const double first = error(next(s));
    EXPECT_EQ(s.stats.samples, 4);
    Picture last;
    for (int i = 2; i <= 64; ++i) {
        last = next(s);
        EXPECT_EQ(s.stats.samples, 4 * i);
        EXPECT_EQ(s.stats.kept, 1);
        EXPECT_GT(s.stats.primaryRays, 0u);
    }
    ASSERT_EQ(last.layers.size(), 1u);
    EXPECT_NEAR(error(last) / first, 1. / 8, .04) << "as the root of the samples";
    // A picture that is not refined shows the same as before.
    s.options.refine = false;
    EXPECT_EQ(next(s).pixels, last.pixels);
    EXPECT_EQ(s.stats.primaryRays, 0u);
    s.options.refine = true;
    ASSERT_TRUE(s.scene.set(s.node("M"), x3d::Material::diffuseColor, Color{.2f, .2f, .2f}));
    s.scene.newFrame(1);
    next(s);
    EXPECT_EQ(s.stats.samples, 4);
}

}  // namespace
}  // namespace rtsg
