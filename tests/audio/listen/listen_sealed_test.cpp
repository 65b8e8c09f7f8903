// Sources that no way leads from to the listener: told once each time, with what is in between; and no false alarms.
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <thread>

#include <rtsg/audio/live_sound.h>

#include "listen_scene.h"

namespace rtsg {
namespace {

using namespace test;

constexpr const char* kTone =
    " Sound { location 0 0 0 minBack 90 minFront 90 maxBack 200 maxFront 200 source "
    "OscillatorSource { frequency 440 } }\n";

class ListenSealed : public Listen {
  protected:
    static std::string shape(const std::string& def, const std::string& geometry, const std::string& at) {
        return "DEF At" + def + " Transform { translation " + at + " children DEF " + def + " Shape { geometry " +
               geometry + " appearance Appearance { acousticProperties DEF Of" + def +
               " AcousticProperties { absorption .1 diffuse .45 specular .45 } } } }\n";
    }
    static std::string view(const std::string& at) { return "DEF Eye Viewpoint { position " + at + " }\n"; }
    static std::vector<std::string> messagesOf(const ListenReport& report) {
        std::vector<std::string> texts;
        for (const Diagnostic& d : report.diagnostics.all()) {
            EXPECT_EQ(d.code.text(), "sealed") << d.format();
            texts.push_back(d.text);
        }
        return texts;
    }
    /// The warnings while a scene is listened to; `at` is called before each frame.
    std::vector<std::string> heard(
        const std::string& body, const std::function<void(Scene&, double)>& at = [](Scene&, double) {},
        double seconds = .1) {
        Scene scene;
        load(scene, body);
        ListenOptions o = options();
        o.seconds = seconds;
        o.render.trace.rays = 200;
        o.render.retraceSeconds = .05;
        o.runTo = [&](double t) {
            at(scene, t);
            scene.newFrame(t);
        };
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        return report ? messagesOf(*report) : std::vector<std::string>{};
    }
    static void move(Scene& scene, const std::string& def, const Vec3f& to) {
        EXPECT_TRUE(scene.set(scene.findName(def), x3d::Transform::translation, to));
    }
};

TEST_F(ListenSealed, ASourceInAClosedBodyIsToldOnceWithBodyAndPlaces) {
    for (const char* body : {"Cylinder { radius 1.5 height 2 }", "Sphere { radius 1.5 }", "Box { size 2 2 3 }",
                             "Cone { bottomRadius 3 height 4 }"}) {
        const auto texts = heard(shape("Drum", body, "0 0 0") + shape("Thing", "Box { size 1 1 1 }", "5 0 0") +
                                 "DEF Voice" + kTone + view("0 0 9"));
        ASSERT_EQ(texts.size(), 1u) << body;
        EXPECT_TRUE(texts[0].starts_with("nothing is heard of Voice: it is at 0 0 0, closed in by Drum (")) << texts[0];
        EXPECT_TRUE(texts[0].ends_with(" m about 0 0 0), and the listener is outside, at 0 0 9")) << texts[0];
    }
}

TEST_F(ListenSealed, AListenerInAClosedBodyIsToldToo) {
    const auto texts = heard(shape("Booth", "Box { size 2 2 3 }", "0 0 9") + "DEF Voice" + kTone + view("0 0 9"));
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_EQ(texts[0],
              "nothing is heard of Voice: the listener is at 0 0 9, closed in by Booth (Box, 2 x 2 x 3 m about 0 0 9), "
              "and the source is outside, at 0 0 0");
}

TEST_F(ListenSealed, WallsOfSeveralShapesAreNamedAndNotCalledClosed) {
    const std::string walls =
        shape("Floor", "Box { size 4.4 .2 4.4 }", "0 -2 0") + shape("Roof", "Box { size 4.4 .2 4.4 }", "0 2 0") +
        shape("West", "Box { size .2 4.4 4.4 }", "-2 0 0") + shape("East", "Box { size .2 4.4 4.4 }", "2 0 0") +
        shape("North", "Box { size 4.4 4.4 .2 }", "0 0 -2");
    const std::string south = shape("South", "Box { size 4.4 4.4 .2 }", "0 0 2"),
                      rest = "DEF Voice" + std::string(kTone) + view("0 0 9");
    EXPECT_TRUE(heard(walls + rest).empty());
    const auto texts = heard(walls + south + rest);
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_TRUE(texts[0].starts_with("nothing is heard of Voice: no way was found out from its place, 0 0 0, past "))
        << texts[0];
    EXPECT_NE(texts[0].find(" and 3 more, to the listener at 0 0 9"), std::string::npos) << texts[0];
}

/// Both in one room; a small body about the source; far, quiet or switched off; in the shadow of a wall in the open; a
/// body that lets sound pass, has a hole, or is none that sound meets.
TEST_F(ListenSealed, NothingIsToldWhereSomethingMightBeHeard) {
    const std::string voice = "DEF Voice" + std::string(kTone), eye = view("0 0 9"),
                      drum = shape("Drum", "Cylinder { radius 1.5 height 2 }", "0 0 0");
    EXPECT_TRUE(heard(shape("Hall", "Box { size 30 30 30 }", "0 0 0") + voice + eye).empty());
    EXPECT_TRUE(heard(shape("Body", "Box { size 1 1 1 }", "0 0 0") + voice + eye).empty());
    EXPECT_TRUE(heard(shape("Wall", "Box { size 60 60 .1 }", "0 0 5") + voice + eye).empty());
    EXPECT_TRUE(heard(shape("Drum", "Cylinder { radius 1.5 height 2 top FALSE }", "0 0 0") + voice + eye).empty());
    // Another is heard: that nothing at all is would be told.
    const std::string other = "AudioDestination { children OscillatorSource { } }\n" + eye;
    EXPECT_TRUE(heard(drum + "DEF Voice Sound { maxFront 5 maxBack 5 source OscillatorSource { } }\n" + other).empty());
    EXPECT_TRUE(
        heard(drum + "DEF Voice Sound { minFront 90 minBack 90 enabled FALSE source OscillatorSource { } }\n" + other)
            .empty());
    EXPECT_TRUE(heard("Shape { geometry Cylinder { radius 1.5 height 2 } appearance Appearance { acousticProperties "
                      "AcousticProperties { absorption .1 refraction .2 } } }\n" +
                      voice + eye)
                    .empty());
}

/// In two rooms with a doorway: hidden, and heard by way of walls alone.
TEST_F(ListenSealed, RoundTwoCornersIsNotSealed) {
    const std::string rooms = shape("Hall", "Box { size 20 4 20 }", "0 0 5") +
                              shape("Left", "Box { size 13 4 .2 }", "-3.5 0 3") +
                              shape("Right", "Box { size 13 4 .2 }", "3.5 0 7");
    EXPECT_TRUE(heard(rooms + "DEF Voice" + kTone + view("0 0 9")).empty());
}

TEST_F(ListenSealed, IsToldAgainOnlyWhenItIsSealedAgain) {
    const std::string body =
        shape("Drum", "Cylinder { radius 1.5 height 2 }", "0 0 0") + "DEF Voice" + kTone + view("0 0 9");
    const auto at = [](Scene& scene, double t) {
        // Away from .2 s to .4 s; in between it turns, which seals nothing anew.
        move(scene, "AtDrum", Vec3f(t > .2 && t < .4 ? 20.0f : 0.0f, t > .1 ? .1f : 0.0f, 0));
    };
    const auto texts = heard(body, at, .6);
    ASSERT_EQ(texts.size(), 2u);
    EXPECT_TRUE(texts[0].starts_with("until 0.2")) << texts[0];
    EXPECT_NE(texts[0].find(" s nothing is heard of Voice: "), std::string::npos) << texts[0];
    // A report of a frame is about the sound since the frame before.
    EXPECT_TRUE(texts[1].starts_with("from 0.3") || texts[1].starts_with("from 0.4")) << texts[1];
    EXPECT_NE(texts[1].find(" s on nothing is heard of Voice: "), std::string::npos) << texts[1];
    // Sealed from .1 to .3 s.
    const auto between = heard(
        body, [](Scene& scene, double t) { move(scene, "AtDrum", Vec3f(t > .1 && t < .3 ? 0.0f : 20.0f, 0, 0)); }, .5);
    ASSERT_EQ(between.size(), 1u);
    EXPECT_TRUE(between[0].starts_with("from 0.1")) << between[0];
    EXPECT_NE(between[0].find(" s to 0."), std::string::npos) << between[0];
}

TEST_F(ListenSealed, WhatFollowsCloseBehindASourceDoesNotPassOverIt) {
    // A cab of .3 m, 3 cm behind its source, at 3 m/s: between frames of 1/20 s both go 15 cm.
    const std::string body = "DEF Train Transform { children [ " + shape("Cab", "Box { size .3 .3 .3 }", "0 0 .18") +
                             "DEF Voice" + kTone + " ] }\n" + view("0 0 9") +
                             shape("Floor", "Box { size 40 .2 40 }", "0 -2 0");
    Scene scene;
    load(scene, body);
    ListenOptions o = options();
    o.seconds = .6;
    o.framesPerSecond = 20;
    o.render.trace.rays = 200;
    o.render.retraceSeconds = .02;
    o.runTo = [&](double t) {
        move(scene, "Train", Vec3f(0, 0, static_cast<float>(-3 * t)));
        scene.newFrame(t);
    };
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    EXPECT_TRUE(messagesOf(*report).empty());
}

TEST_F(ListenSealed, WhatPlaysOnlyOnceItIsOutIsNotTold) {
    const std::string body = shape("Drum", "Cylinder { radius 1.5 height 2 }", "0 0 0") +
                             "DEF Voice Sound { minBack 90 minFront 90 maxBack 200 maxFront 200 source DEF Tone "
                             "OscillatorSource { startTime .2 } }\n" +
                             view("0 0 9");
    EXPECT_TRUE(heard(
                    body,
                    [](Scene& scene, double t) {
                        if (t > .1) move(scene, "AtDrum", Vec3f(20, 0, 0));
                    },
                    .3)
                    .empty());
    EXPECT_EQ(heard(body, [](Scene&, double) {}, .3).size(), 1u);
}

TEST_F(ListenSealed, FiguresThatDoNotExistAreToldAndNothingLeaksIntoThem) {
    Scene scene;
    load(scene, shape("Drum", "Cylinder { radius 1 height 2 }", "0 0 0") + "DEF Voice" + kTone + view("0 0 9"));
    ListenOptions o = options();
    o.metrics = true;
    o.seconds = .1;
    o.trace.rays = 20'000;
    o.error = .5;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    EXPECT_EQ(messagesOf(*report).size(), 1u);
    ASSERT_EQ(report->sources.size(), 1u);
    EXPECT_TRUE(report->sources[0].trace.silent());
    EXPECT_TRUE(std::isnan(report->sources[0].metrics.value.g[kBand1k]));
    EXPECT_LT(report->rays, 21'000u);  // no more of them for nothing
}

TEST_F(ListenSealed, TheSourceHasItsLineInTheDocument) {
    for (const bool named : {true, false}) {
        const std::string text = "#X3D V4.0 utf8\nPROFILE Full\n" +
                                 shape("Drum", "Cylinder { radius 1.5 height 2 }", "0 0 0") + "# about\n  " +
                                 (named ? "DEF Voice" : "") + kTone + view("0 0 9");
        const std::filesystem::path file = folder_ / "drum.x3dv";
        std::ofstream(file) << text;
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadFile(scene, file, diagnostics));
        ListenOptions o = options();
        o.seconds = .1;
        o.render.document = file;
        const auto report = listen(scene, o);
        ASSERT_TRUE(report);
        ASSERT_EQ(report->diagnostics.all().size(), 1u);
        EXPECT_EQ(report->diagnostics.all()[0].file, file.string());
        EXPECT_EQ(report->diagnostics.all()[0].where.line, 5u) << named;
    }
}

TEST_F(ListenSealed, LiveSoundTellsWhenItStops) {
    ::setenv("ALSOFT_DRIVERS", "null", 1);
    Scene scene;
    load(scene, shape("Drum", "Cylinder { radius 1.5 height 2 }", "0 0 0") + "DEF Voice" + kTone + view("0 0 9"));
    SharedWorld world(scene);
    auto sound = LiveSound::start(world, {});
    ASSERT_TRUE(sound) << sound.error().text;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    double t = 0;
    // The response comes from another thread, and what it says a block later.
    for (std::uint64_t blocks = 0; std::chrono::steady_clock::now() < end;) {
        scene.newFrame(t += .01);
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        const LiveReport now = (*sound)->report();
        if (now.heard.responses == 0) blocks = now.blocks;
        if (now.blocks > blocks + 8) break;
    }
    const LiveReport report = (*sound)->stop();
    ASSERT_EQ(report.diagnostics.all().size(), 1u);
    EXPECT_EQ(report.diagnostics.all()[0].code.text(), "sealed");
}

}  // namespace
}  // namespace rtsg
