// Drags against closed forms in code of its own, and pointers' events that are many, late, broken or lies.
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/frame_input.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "support/simple_space.h"

namespace rtsg {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

struct PointerScene {
    Scene scene;
    test::SimpleSpace space{scene};
    double time = 0;
    std::vector<std::string> events;

    explicit PointerScene(const std::string& text, bool looks = true) {
        Diagnostics diagnostics("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        if (looks) scene.setSpaceQueries(&space);
        scene.newFrame(0);
    }
    const Node& node(const char* name = "S") const { return scene.node(scene.findName(name)); }
    void send(std::uint32_t buttons, const Vec3d& origin, const Vec3d& direction, std::int32_t device = 0) {
        PointerInput input;
        input.device = device;
        input.buttons = buttons;
        input.origin = origin;
        input.direction = direction;
        ASSERT_TRUE(sendPointer(scene, input));
    }
    void listen(const char* name) {
        scene.setEventListener([this, name](double, const Node& n, FieldIndex field, const Value& value) {
            if (n.id() != scene.findName(name) || !value.holds<bool>()) return;
            events.push_back(n.type().fields[field].name + (value.as<bool>() ? "+" : "-"));
        });
    }
    std::shared_ptr<const ChangeSet> frame() { return scene.newFrame(time += 1); }
    std::string problems() {
        std::string text;
        for (const Diagnostic& d : scene.diagnostics().all()) text += d.text + "\n";
        return text;
    }
};

// ---- closed forms --------------------------------------------------------------------------------------------------

/// A transform and rays in its coordinates, for drags that are the same wherever they happen.
struct RandomPose {
    glm::dmat4 world{1};
    std::string text;
    explicit RandomPose(std::mt19937& random) {
        std::uniform_real_distribution<double> any(-3, 3), positive(.3, 3);
        const glm::vec3 axis = glm::normalize(glm::vec3(any(random), any(random), any(random))),
                        move(any(random), any(random), any(random));
        const float angle = static_cast<float>(any(random)), scale = static_cast<float>(positive(random));
        world = glm::translate(glm::dmat4(1), glm::dvec3(move)) *
                glm::rotate(glm::dmat4(1), double(angle), glm::dvec3(axis)) *
                glm::scale(glm::dmat4(1), glm::dvec3(scale));
        std::ostringstream out;
        out.precision(9);
        out << "Transform { translation " << move.x << ' ' << move.y << ' ' << move.z << " rotation " << axis.x << ' '
            << axis.y << ' ' << axis.z << ' ' << angle << " scale " << scale << ' ' << scale << ' ' << scale
            << " children [ ";
        text = out.str();
    }
    Vec3d point(const Vec3d& p) const { return world * glm::dvec4(p, 1); }
    Vec3d direction(const Vec3d& d) const { return world * glm::dvec4(d, 0); }
};

TEST(Drags, ACylinderTurnsByTheArcSineOfTheWayBeside) {
    std::mt19937 random(3);
    for (int run = 0; run < 40; ++run) {
        const RandomPose pose(random);
        PointerScene s(pose.text + "DEF S CylinderSensor { } Shape { geometry Sphere { radius 2 } } ] }");
        // Parallel rays along -Z from x, at a height of h: on a sphere of radius 2 the cylinder's radius is that of the
        // circle at h; x / radius is the sine, and beyond the edge each radius more is one radian more.
        std::uniform_real_distribution<double> heights(-1.5, 1.5), paths(-.95, .95), far(-4, 4);
        const double h = heights(random), radius = std::sqrt(4 - h * h), from = paths(random);
        const auto angle = [](double distance) {
            return std::abs(distance) <= 1 ? std::asin(distance)
                                           : std::copysign(M_PI / 2 + std::abs(distance) - 1, distance);
        };
        const auto send = [&](std::uint32_t buttons, double distance, double y) {
            s.send(buttons, pose.point({distance * radius, y, 10}), pose.direction({0, 0, -1}));
            s.frame();
        };
        send(0, from, h);
        send(1, from, h);
        ASSERT_TRUE(s.node().get(x3d::CylinderSensor::isActive)) << run;
        for (int i = 0; i < 10; ++i) {
            const double distance = far(random);
            send(1, distance, heights(random));
            const Rotation r = s.node().get(x3d::CylinderSensor::rotation_changed);
            EXPECT_NEAR(r.y, 1, 1e-6);
            EXPECT_NEAR(r.angle, angle(distance) - angle(from), 2e-5) << run << ' ' << distance;
            const Vec3f p = s.node().get(x3d::CylinderSensor::trackPoint_changed);
            EXPECT_NEAR(std::hypot(p.x, p.z), radius, 1e-4);
        }
    }
}

TEST(Drags, ASphereTurnsThePointThatWasHitToWhereTheRayMeetsIt) {
    std::mt19937 random(5);
    for (int run = 0; run < 40; ++run) {
        const RandomPose pose(random);
        PointerScene s(pose.text +
                       "DEF S SphereSensor { autoOffset FALSE offset 1 0 0 .5 } Shape { geometry Sphere { } } ] }");
        std::uniform_real_distribution<double> distance(-.7, .7), angles(-M_PI, M_PI), more(0, 1.5);
        const auto send = [&](std::uint32_t buttons, double x, double y) {
            s.send(buttons, pose.point({x, y, 10}), pose.direction({0, 0, -1}));
            s.frame();
        };
        const double x = distance(random), y = distance(random);
        send(1, x, y);
        const glm::dvec3 start(x, y, std::sqrt(1 - x * x - y * y));
        for (int i = 0; i < 10; ++i) {
            // Over the sphere, or beyond its edge by `beyond` radii in some direction: so far round the back.
            glm::dvec3 expected;
            if (i % 2) {
                const double beyond = more(random), a = angles(random);
                send(1, (1 + beyond) * std::cos(a), (1 + beyond) * std::sin(a));
                expected = {std::cos(a) * std::cos(beyond), std::sin(a) * std::cos(beyond), -std::sin(beyond)};
            } else {
                const double u = distance(random), v = distance(random);
                send(1, u, v);
                expected = {u, v, std::sqrt(1 - u * u - v * v)};
            }
            const Vec3f p = s.node().get(x3d::SphereSensor::trackPoint_changed);
            EXPECT_LT(glm::distance(glm::dvec3(p), expected), 2e-5);
            // The point before the offset and the point now are the same point, rotated about the axis of both.
            const Rotation r = s.node().get(x3d::SphereSensor::rotation_changed);
            const glm::dmat3 rotation(glm::rotate(glm::dmat4(1), double(r.angle), glm::dvec3(r.x, r.y, r.z)));
            const glm::dmat3 offset(glm::rotate(glm::dmat4(1), double(.5f), glm::dvec3(1, 0, 0)));
            EXPECT_LT(glm::distance(rotation * glm::transpose(offset) * start, expected), 2e-5);
            const glm::dvec3 still = glm::normalize(glm::cross(start, expected));
            EXPECT_LT(glm::distance(rotation * glm::transpose(offset) * still, still), 1e-3) << run << ' ' << i;
        }
    }
}

TEST(Drags, APlaneIsThroughThePointThatWasHitWhateverTheRays) {
    std::mt19937 random(9);
    for (int run = 0; run < 40; ++run) {
        const RandomPose pose(random);
        PointerScene s(pose.text + "DEF S PlaneSensor { autoOffset FALSE } Shape { geometry Box { } } ] }");
        std::uniform_real_distribution<double> at(-.8, .8), beyond(-5, 5), slant(-.5, .5);
        const auto send = [&](const Vec3d& through) {
            const Vec3d d(slant(random), slant(random), -1);
            s.send(1, pose.point(through - 7.0 * d), pose.direction(d));
            s.frame();
        };
        const double x = at(random), y = at(random);
        s.send(1, pose.point({x, y, 8}), pose.direction({0, 0, -1}));
        s.frame();
        for (int i = 0; i < 10; ++i) {
            const double u = beyond(random), v = beyond(random);
            send({u, v, 1});
            EXPECT_LT(glm::distance(s.node().get(x3d::PlaneSensor::translation_changed),
                                    Vec3f(static_cast<float>(u - x), static_cast<float>(v - y), 0)),
                      3e-5);
        }
    }
}

// ---- what a frame takes
// ----------------------------------------------------------------------------------------------

const char* const kTouched =
    "Group { children [ DEF S TouchSensor { description \"a bell\" } Shape { geometry Box { } } ] }";

TEST(Pointers, AClickWithinOneFrameIsPressedInOneAndLetGoInTheNext) {
    PointerScene s(kTouched);
    s.listen("S");
    s.send(0, {5, 0, 9}, {0, 0, -1});
    s.send(0, {.2, 0, 9}, {0, 0, -1});
    s.send(1, {.1, 0, 9}, {0, 0, -1});
    s.send(0, {0, 0, 9}, {0, 0, -1});
    s.send(1, {0, .1, 9}, {0, 0, -1});
    s.send(1, {0, .2, 9}, {0, 0, -1});
    s.send(0, {0, .2, 9}, {0, 0, -1});
    s.frame();
    EXPECT_THAT(s.events, ElementsAre("isOver+", "isActive+"));
    EXPECT_EQ(s.node().get(x3d::TouchSensor::hitPoint_changed), Vec3f(.1f, 0, 1));
    for (int i = 0; i < 4; ++i) s.frame();
    EXPECT_THAT(s.events, ElementsAre("isOver+", "isActive+", "isActive-", "isActive+", "isActive-"));
    EXPECT_EQ(s.node().get(x3d::TouchSensor::touchTime).seconds, 4);
}

TEST(Pointers, WaitTheirTurnWhateverElseComesIntoTheFrame) {
    PointerScene s(std::string(kTouched) + "DEF OTHER BooleanToggle { }");
    s.listen("S");
    const auto other = [&] {
        ASSERT_TRUE(s.scene.sendEvent(s.scene.findName("OTHER"), x3d::BooleanToggle::set_boolean.index, Value(true)));
    };
    other();
    s.send(1, {.1, 0, 9}, {0, 0, -1});
    other();
    s.send(0, {.1, 0, 9}, {0, 0, -1});
    other();
    s.frame();
    EXPECT_THAT(s.events, ElementsAre("isOver+", "isActive+"));
    s.frame();
    EXPECT_THAT(s.events, ElementsAre("isOver+", "isActive+", "isActive-"));
}

TEST(Pointers, TheEndOfADragIsWhereTheButtonIsLetGo) {
    PointerScene s("Group { children [ DEF S PlaneSensor { } Shape { geometry Box { } } ] }");
    s.send(1, {0, 0, 9}, {0, 0, -1});
    s.frame();
    s.send(1, {.25, 0, 9}, {0, 0, -1});
    s.send(0, {.5, 0, 9}, {0, 0, -1});
    s.frame();
    EXPECT_FALSE(s.node().get(x3d::PlaneSensor::isActive));
    EXPECT_EQ(s.node().get(x3d::PlaneSensor::offset), Vec3f(.5f, 0, 0));
}

TEST(Pointers, MoreClicksThanFramesEndAsTheLastOneDid) {
    PointerScene s(kTouched);
    for (int i = 0; i < 5000; ++i) s.send(i % 2 ? 0 : 1, {0, 0, 9}, {0, 0, -1});
    s.send(1, {.5, 0, 9}, {0, 0, -1});
    for (int i = 0; i < 5; ++i) s.frame();
    EXPECT_TRUE(s.node().get(x3d::TouchSensor::isActive));
    EXPECT_THAT(s.problems(), HasSubstr("left out"));
}

TEST(Pointers, APlaceInThePictureIsABearing) {
    PointerScene s(std::string("DEF V Viewpoint { position 5 0 0 orientation 0 1 0 1.57079633 fieldOfView 1.2 } ") +
                   kTouched);
    PointerInput input;
    input.kind = PointerInput::Kind::picture;
    input.x = input.y = .5;
    input.aspect = 2;
    ASSERT_TRUE(sendPointer(s.scene, input));
    s.frame();
    EXPECT_TRUE(s.node().get(x3d::TouchSensor::isOver));
    EXPECT_LT(glm::distance(s.node().get(x3d::TouchSensor::hitPoint_changed), Vec3f(1, 0, 0)), 1e-6f);
    const Bearing corner = bearingThrough(s.scene, 1, 0, 2);
    const double t = std::tan(.6);
    EXPECT_LT(glm::distance(corner.direction, glm::normalize(Vec3d(-1, t, -2 * t))), 1e-6);
    EXPECT_LT(glm::distance(corner.origin, Vec3d(5, 0, 0)), 1e-9);
}

TEST(Pointers, AnOrthoViewpointHasParallelBearings) {
    PointerScene s("OrthoViewpoint { position 1 2 9 fieldOfView [ -1 -2 3 2 ] }");
    const Bearing b = bearingThrough(s.scene, .75, .25, 2);
    EXPECT_EQ(b.direction, Vec3d(0, 0, -1));
    EXPECT_LT(glm::distance(b.origin, Vec3d(1 + 1 + .5 * 4, 2 + .5 * 2, 9)), 1e-9);
}

TEST(Pointers, AnAnchorThatIsActivatedIsToldToTheApplication) {
    PointerScene s("DEF S Anchor { url \"next.x3d\" children Shape { geometry Box { } } }");
    s.send(1, {0, 0, 9}, {0, 0, -1});
    s.frame();
    s.send(0, {0, 0, 9}, {0, 0, -1});
    s.frame();
    const auto number = s.scene.node(s.scene.root()).get(x3d::RtsgScene::anchor);
    EXPECT_EQ(static_cast<std::uint32_t>(number), s.scene.findName("S").value);
}

TEST(Pointers, AnAnchorBindsTheFirstOfItsViewpointsThatIsThere) {
    PointerScene s(
        "Viewpoint { } DEF V Viewpoint { } DEF W Viewpoint { } DEF G Group { } DEF S Anchor { url [ \"#NOBODY\" "
        "\"#G\" \"next.x3d\" \"#V\" \"#W\" ] children Shape { geometry Box { } } }");
    s.send(1, {0, 0, 9}, {0, 0, -1});
    s.frame();
    s.send(0, {0, 0, 9}, {0, 0, -1});
    s.frame();
    EXPECT_TRUE(s.node("V").get(x3d::Viewpoint::isBound));
    EXPECT_FALSE(s.node("W").get(x3d::Viewpoint::isBound));
}

// ---- hostile
// -----------------------------------------------------------------------------------------------------------

TEST(Pointers, WhatAPeerClaimsToHaveHitCountsOnlyWhereNobodyCanLook) {
    const auto over = [](bool looks, std::uint32_t wrong) {
        PointerScene s(kTouched, looks);
        PointerInput input;
        input.origin = {50, 0, 9};
        input.hit = PointerHit{{0, 0, 1},
                               {0, 0, 1},
                               {0, 0},
                               {s.scene.node(s.scene.root()).get(x3d::RtsgScene::children)[0], NodeId{wrong}}};
        EXPECT_TRUE(sendPointer(s.scene, input));
        s.frame();
        return s.node().get(x3d::TouchSensor::isOver);
    };
    EXPECT_FALSE(over(true, 3));
    EXPECT_TRUE(over(false, 3));
    EXPECT_TRUE(over(false, 4'000'000'000u)) << "a node that there is not ends the path";
}

TEST(Pointers, NumbersAtRandomDoNoHarm) {
    std::mt19937 random(11);
    const double odd[] = {NAN, INFINITY,     -INFINITY,    0, -0.0, 1, -1, 2, .5, 1e308, -1e308, 1e-310, 63,
                          64,  4294967295.0, 4294967296.0, 3, 4,    5};
    PointerScene s(
        "Group { children [ DEF S TouchSensor { } DEF P PlaneSensor { } DEF C CylinderSensor { } DEF B SphereSensor "
        "{ } Shape { geometry Box { } } ] } Transform { scale 0 1 1 children [ PlaneSensor { } ] }");
    for (int run = 0; run < 2; ++run) {
        s.scene.setSpaceQueries(run ? &s.space : nullptr);
        for (int i = 0; i < 20'000; ++i) {
            Array<double> numbers;
            const std::size_t count = random() % 4 ? 10 + random() % 14 : random() % 40;
            for (std::size_t k = 0; k < count; ++k)
                numbers.push_back(k < 3 && random() % 8 ? double(random() % 2) : odd[random() % std::size(odd)]);
            ASSERT_TRUE(s.scene.sendEvent(s.scene.root(), x3d::RtsgScene::pointer.index, numbers));
            Array<std::int32_t> key{std::int32_t(random() % 3), std::int32_t(random()),
                                    std::int32_t(random() % 30) - 2};
            ASSERT_TRUE(s.scene.sendEvent(s.scene.root(), x3d::RtsgScene::key.index, key));
            ASSERT_TRUE(s.scene.sendEvent(s.scene.root(), x3d::RtsgScene::contact.index, key));
            if (i % 3 == 0) s.frame();
        }
        for (const char* name : {"S", "P", "C", "B"})
            for (FieldIndex f = 0; f < s.node(name).type().fields.size(); ++f)
                if (s.node(name).type().fields[f].type == FieldType::SFVec3f) {
                    const Vec3f v = s.node(name).value(f).as<Vec3f>();
                    EXPECT_TRUE(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)) << name;
                }
    }
    // It goes on working.
    s.send(0, {50, 50, 50}, {0, 0, 1}, 5);
    for (int i = 0; i < 600; ++i) s.frame();
    for (std::int32_t device = 0; device < 64; ++device) s.send(0, {50, 50, 50}, {0, 0, 1}, device);
    for (int i = 0; i < 300; ++i) s.frame();
    s.send(1, {.5, 0, 9}, {0, 0, -1}, 7);
    s.frame();
    EXPECT_TRUE(s.node().get(x3d::TouchSensor::isActive));
}

TEST(Keys, EveryCodePointIsATextOrRefused) {
    PointerScene s("DEF K KeySensor { }");
    for (const std::int64_t code :
         {1L, 0x41L, 0x7FL, 0x80L, 0x7FFL, 0x800L, 0xD7FFL, 0xE000L, 0xFFFFL, 0x10000L, 0x10FFFFL}) {
        KeyInput key;
        key.character = static_cast<char32_t>(code);
        ASSERT_TRUE(sendKey(s.scene, key)) << code;
        s.frame();
        const String text = s.node("K").get(x3d::KeySensor::keyPress);
        EXPECT_EQ(text.view().size(), code < 0x80 ? 1u : code < 0x800 ? 2u : code < 0x10000 ? 3u : 4u);
        const auto again = KeyInput::named(text.view(), true);
        ASSERT_TRUE(again) << code;
        EXPECT_EQ(again->character, static_cast<char32_t>(code));
    }
    for (const std::uint32_t code : {0u, 0xD800u, 0xDFFFu, 0x110000u, 0xFFFFFFFFu}) {
        KeyInput key;
        key.character = code;
        EXPECT_FALSE(sendKey(s.scene, key)) << code;
    }
    for (const char* name :
         {"", "F0", "F13", "HOMES", "U+D800", "U+110000", "U+", "ab", "\xC0\x80", "\xED\xA0\x80", "\xFF"})
        EXPECT_FALSE(KeyInput::named(name, true)) << name;
}

TEST(Keys, ComeOneAFrameAndTextsALineAFrame) {
    PointerScene s("DEF S StringSensor { }");
    std::vector<std::string> finals;
    s.scene.setEventListener([&](double, const Node& n, FieldIndex field, const Value& value) {
        if (n.is(x3d::StringSensor::type) && field == x3d::StringSensor::finalText.index)
            finals.push_back(value.as<String>().str());
    });
    for (const char c : std::string("hello"))
        for (const bool down : {true, false}) ASSERT_TRUE(sendKey(s.scene, {down, static_cast<char32_t>(c)}));
    ASSERT_TRUE(sendText(s.scene, " one\ntwo\n\nthree \xFF\n"));
    for (int i = 0; i < 14; ++i) s.frame();
    EXPECT_THAT(finals, ElementsAre("hello one", "two", "", "three \xEF\xBF\xBD"));
    for (int i = 0; i < 1000; ++i) ASSERT_TRUE(sendKey(s.scene, {true, U'x'}));
    for (int i = 0; i < 400; ++i) s.frame();
    EXPECT_EQ(s.node().get(x3d::StringSensor::enteredText).view().size(), 257u);
    EXPECT_THAT(s.problems(), HasSubstr("keys came faster"));
}

TEST(Keys, ATextWithoutAnEndStopsGrowing) {
    PointerScene s("DEF S StringSensor { }");
    for (int i = 0; i < 30; ++i) {
        ASSERT_TRUE(sendText(s.scene, std::string(10'000, 'x')));
        s.frame();
    }
    EXPECT_LE(s.node().get(x3d::StringSensor::enteredText).view().size(), std::size_t{64} << 10);
    EXPECT_THAT(s.problems(), HasSubstr("64 KiB"));
}

TEST(Devices, WheelsAndHeadsAreEventsThatAreRecorded) {
    PointerScene s("Group { }");
    ASSERT_TRUE(sendWheel(s.scene, 0, -3));
    ASSERT_TRUE(sendHeadPose(s.scene, {0, 1.7, 0}, {0, 1, 0, .5f}));
    const auto set = s.frame();
    ASSERT_EQ(set->changes.size(), 2u);
    EXPECT_EQ(set->changes[0].kind, ChangeKind::event);
    EXPECT_EQ(set->changes[0].value, Value(Array<double>{0, -3}));
    EXPECT_EQ(set->changes[1].value, Value(Array<double>{0, 1.7, 0, 0, 1, 0, .5}));
    EXPECT_FALSE(sendWheel(s.scene, NAN, 0));
    EXPECT_FALSE(sendHeadPose(s.scene, {INFINITY, 0, 0}, {}));
    PointerInput input;
    input.device = 64;
    EXPECT_FALSE(sendPointer(s.scene, input));
}

TEST(Devices, InputModeRunsTheSameWithoutGeometry) {
    PointerScene s(
        "DEF T Transform { children [ DEF S PlaneSensor { } Shape { geometry Box { } } ] } ROUTE S.translation_changed "
        "TO "
        "T.translation");
    s.scene.setInputRecording(true);
    Scene other;
    auto first = std::make_shared<ChangeSet>(s.scene.snapshot());
    ASSERT_TRUE(other.apply(first));
    ASSERT_TRUE(other.resumeFrom(s.scene.runState()));
    for (int i = 0; i < 10; ++i) {
        PointerInput input;
        input.kind = PointerInput::Kind::picture;
        input.x = .5 + i * .01;
        input.y = .5;
        input.buttons = i < 8 ? 1 : 0;
        ASSERT_TRUE(sendPointer(s.scene, input));
        const auto set = s.frame();
        ASSERT_TRUE(set->input);
        const auto again = other.runInput(*set->input, set->time);
        ASSERT_TRUE(again) << again.error().text;
        EXPECT_EQ(other.hash(), s.scene.hash()) << i;
    }
    EXPECT_GT(s.node().get(x3d::PlaneSensor::offset).x, 0);
}

}  // namespace
}  // namespace rtsg
