// Live sound on OpenAL's silent device, and responses that are made in the background.
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/audio/live_sound.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "engine/acoustic_engine.h"
#include "scene/acoustic_tables.h"
#include "sound_io/sound_device.h"

namespace rtsg {
namespace {

/// Before OpenAL is first asked for anything: a device that plays in time, and silently.
const int kSilent = ::setenv("ALSOFT_DRIVERS", "null", 1);

const char* const kRoom =
    "#X3D V4.0 utf8\nPROFILE Full\n"
    "Transform { translation 3 2.5 1.5 children Shape { geometry Box { size 6 5 3 solid FALSE } } }\n"
    "DEF Voice Transform { children Sound { intensity .1 location 1 1 1.5 minBack 30 minFront 30 maxBack 60 maxFront "
    "60 source "
    "OscillatorSource { frequency 440 } } }\nViewpoint { position 4 3 1.5 }\n";

AcousticOptions fewLive() {
    AcousticOptions options;
    options.trace.rays = 400;
    options.trace.maxSeconds = 1;
    return options;
}

/// A scene whose sound plays on the device.
struct Playing {
    Scene scene;
    Diagnostics diagnostics;
    SharedWorld world{scene};
    LiveOptions options;
    std::unique_ptr<LiveSound> live;

    explicit Playing(const std::string& text) {
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        options.render = fewLive();
        auto started = LiveSound::start(world, options);
        if (started)
            live = std::move(*started);
        else
            ADD_FAILURE() << started.error().text;
    }
};

/// Rays that can be frozen.
struct LiveRays final : InstanceSubscriber {
    RayWorld world;
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        world.apply(delta);
        return {};
    }
};

/// A scene whose sound an engine makes block by block, at one state of the scene.
struct Rendered {
    Scene scene;
    Diagnostics diagnostics;
    SharedWorld world{scene};
    LiveRays own;
    AcousticTables tables{own.world};
    std::shared_ptr<const WorldVersion> rays;

    explicit Rendered(const std::string& text, double start = 0) {
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        world.add(own);
        world.add(tables);
        scene.newFrame(start);
        freeze();
    }
    ~Rendered() {
        world.remove(tables);
        world.remove(own);
    }
    Rendered(const Rendered&) = delete;
    Rendered& operator=(const Rendered&) = delete;
    void freeze() { rays = own.world.freeze(); }
    bool block(AcousticEngine& engine, double t, SoundBuffer& out) {
        return engine.renderLive(tables.latest(), rays, t, out).has_value();
    }
};

TEST(SoundDevice, TakesBlocksInTimeAndCountsWhatComesTooLate) {
    ASSERT_EQ(kSilent, 0);
    auto device = SoundDevice::open({.blockSize = 12000, .blocks = 4});
    ASSERT_TRUE(device) << device.error().text;
    const std::vector<float> block(2 * 12000, .1f);
    EXPECT_EQ(device->free(), 4u);
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(device->write(block));
    EXPECT_FALSE(device->write(block));
    EXPECT_GT(device->latencySeconds(), .02);
    // One second is there; after much longer it is played, and nothing followed.
    for (int i = 0; i < 2000 && device->free() < 4; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_EQ(device->free(), 4u);
    EXPECT_EQ(device->underruns(), 1u);
    // It goes on after that: what comes now waits to be played, as before, and is not taken as fast as it can be made.
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(device->write(block));
    EXPECT_EQ(device->underruns(), 1u);
    EXPECT_EQ(device->free(), 0u);
    EXPECT_FALSE(device->write(block));
    EXPECT_FALSE(SoundDevice::open({.name = "no such device"}));
    EXPECT_FALSE(SoundDevice::open({.blockSize = 1}));
}

TEST(LiveSound, PlaysWhileTheSceneRunsAndTracesBeside) {
    Playing play(kRoom);
    ASSERT_TRUE(play.live);
    Scene& scene = play.scene;
    // Until something was traced; a machine that is busy takes its time.
    const auto start = std::chrono::steady_clock::now();
    double t = 0;
    while (play.live->report().heard.responses < 3 && t < 60) {
        t = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        ASSERT_TRUE(
            scene.set(scene.findName("Voice"), x3d::Transform::translation, Vec3f(static_cast<float>(t), 0, 0)));
        scene.newFrame(t);
        std::this_thread::sleep_for(std::chrono::milliseconds(16));
        if (t > 2.5) break;
    }
    const LiveReport report = play.live->stop();
    EXPECT_EQ(report.failure, "");
    EXPECT_GE(report.heard.responses, 1u);
    EXPECT_GT(report.blocks, 10u);
    EXPECT_GT(report.latencySeconds, 0);
    // Six blocks that wait and what the device says of itself: no matter how busy the machine is.
    EXPECT_LE(report.latencySeconds, .05);
    for (const Diagnostic& d : report.diagnostics.all()) ADD_FAILURE() << d.text;
    // The world goes on without it.
    scene.newFrame(t + 1);
    EXPECT_EQ(play.world.failure(), "");
    LiveOptions missing;
    missing.device = "no such device";
    EXPECT_FALSE(LiveSound::start(play.world, missing));
}

/// The device's first block is of the scene as it is, whenever that goes on: walls of thousands of triangles that came
/// while it plays would be looked at in haste.
TEST(LiveSound, BeginsWithTheSceneAsItIs) {
    Playing play(kRoom);
    ASSERT_TRUE(play.live);
    for (int i = 0; i < 2000 && play.live->report().heard.responses == 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const LiveReport report = play.live->stop();
    EXPECT_GE(report.heard.responses, 1u);
    EXPECT_GT(report.heard.images, 5u) << "of the room";
}

TEST(LiveSound, WhatNodesFindComesBackWhileItPlays) {
    Playing play(
        "#X3D V4.0 utf8\nPROFILE Full\nDEF Out AudioDestination { children DEF C DynamicsCompressor { "
        "threshold -24 knee 0 ratio 4 attack .01 release .01 children DEF A Analyser { fftSize 64 "
        "children BufferAudioSource { loop TRUE buffer [ .5 -.5 ] } } } }\nViewpoint { }\n");
    ASSERT_TRUE(play.live);
    Scene& scene = play.scene;
    const auto start = std::chrono::steady_clock::now();
    const auto until = [&](const auto& done) {
        double t = scene.now();
        const double end = t + 60;
        while (!done() && t < end) {
            t = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
            play.live->sendEvents();
            scene.newFrame(t);
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        return done();
    };
    const auto reduction = [&] {
        return static_cast<double>(scene.node(scene.findName("C")).get(x3d::DynamicsCompressor::reduction));
    };
    const double all = -.75 * (24 + 20 * std::log10(.5));
    EXPECT_TRUE(until([&] { return std::abs(reduction() - all) < 1e-5; })) << reduction();
    EXPECT_TRUE(until([&] { return scene.node(scene.findName("A")).get(x3d::Analyser::frequencyBinCount) == 32; }));
    // A device that is fed no more tells nothing any more; the scene goes on.
    EXPECT_EQ(play.live->stop().failure, "");
    play.live->sendEvents();
    play.live->sendEvents();
    scene.newFrame(scene.now() + 1);
    EXPECT_NEAR(reduction(), all, 1e-5);
}

TEST(LiveSound, WhatIsBeyondFullScaleIsCountedAndToldOnce) {
    for (const char* gain : {"2", ".9"}) {
        Playing play(std::string("#X3D V4.0 utf8\nPROFILE Full\nAudioDestination { gain ") + gain +
                     " children BufferAudioSource { loop TRUE buffer [ 1 .1 -1 ] } }\nViewpoint { }\n");
        ASSERT_TRUE(play.live);
        Scene& scene = play.scene;
        for (int i = 1; i <= 12'000 && (i < 10 || play.live->report().blocks < 20); ++i) {
            scene.newFrame(.005 * i);
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        const LiveReport report = play.live->stop();
        if (gain[0] == '.') {
            EXPECT_EQ(report.clipped, 0u);
            EXPECT_TRUE(report.diagnostics.all().empty());
            continue;
        }
        // Two samples of three, in both channels.
        EXPECT_GT(report.clipped, 0u);
        EXPECT_LE(report.clipped, report.blocks * play.options.render.blockSize * 4 / 3 + 4);
        ASSERT_EQ(report.diagnostics.all().size(), 1u);
        EXPECT_NE(report.diagnostics.all()[0].text.find(" samples were beyond full scale, by up to 6.0 dB"),
                  std::string::npos)
            << report.diagnostics.all()[0].text;
    }
}

/// Times of today are doubles 2.4e-7 s apart, .01 samples: added up block by block they would lose a sample now and
/// then.
TEST(LiveSound, NoSampleIsLostAtAnyClock) {
    for (const double start : {0.0, 946684800.0, 1795000000.123}) {
        Rendered room(kRoom, start);
        AcousticOptions options = fewLive();
        options.startTime = start;
        options.reflections = false;
        auto engine = *AcousticEngine::create(options);
        const auto first = std::llround(start * 48000);
        for (std::int64_t block = 1; block <= 4000; ++block) {
            EXPECT_EQ(std::llround(engine->liveEnd() * 48000), first + block * 256) << start;
            SoundBuffer out;
            ASSERT_TRUE(room.block(*engine, start, out));
            ASSERT_EQ(out.samples.size(), 2u * 256) << start << " in block " << block;
        }
    }
}

/// A source that is to be traced anew all of the time leaves the worker time for one that comes after it.
TEST(LiveSound, EachSourceIsTracedInItsTurn) {
    const std::string walls = kRoom, busy =
                                         "DEF Busy Transform { translation 2 2 1 children SpatialSound { children "
                                         "BufferAudioSource { loop TRUE buffer [ "
                                         "0 ] } } }\n";
    const std::size_t head = walls.find("Transform");
    Rendered room(walls.substr(0, head) + busy + walls.substr(head));
    AcousticOptions options = fewLive(), straight = fewLive();
    options.background = true;
    options.retraceSeconds = 0;
    straight.reflections = false;
    auto engine = *AcousticEngine::create(options), direct = *AcousticEngine::create(straight);
    // One for the busy one, one for the other, and more; then until sound has come from the walls.
    const auto start = std::chrono::steady_clock::now();
    double reflected = 0;
    for (int block = 0, after = 0; after < 60 && std::chrono::steady_clock::now() - start < std::chrono::seconds(60);
         ++block) {
        const double t = engine->liveEnd(), distance = .15 * block;
        if (engine->heard().responses < 4) {
            const auto x = static_cast<float>(1 + std::abs(distance - 6 * std::floor(distance / 6) - 3));
            ASSERT_TRUE(room.scene.set(room.scene.findName("Busy"), x3d::Transform::translation, Vec3f(x, 2, 1)));
            room.scene.newFrame(t);
        } else {
            ++after;
        }
        room.freeze();
        SoundBuffer all, part;
        ASSERT_TRUE(room.block(*engine, t, all));
        ASSERT_TRUE(room.block(*direct, t, part));
        for (std::size_t i = 0; i < all.samples.size(); ++i)
            reflected = std::max(reflected, std::abs(static_cast<double>(all.samples[i] - part.samples[i])));
    }
    EXPECT_GE(engine->heard().responses, 4u);
    EXPECT_GE(reflected, 1e-3);
}

/// Reflections that come while a tone sounds begin softly; they would be heard block by block, as gaps and steps.
TEST(LiveSound, TheFirstReflectionsComeWithoutAStep) {
    Rendered room(kRoom);
    AcousticOptions options = fewLive();
    options.background = true;
    auto engine = *AcousticEngine::create(options);
    SoundBuffer out;
    int blocks = 0;
    for (int after = 0; after < 60 && blocks < 60'000; ++blocks, after += engine->heard().responses > 0) {
        ASSERT_TRUE(room.block(*engine, 0, out));
        if (blocks < 20 || after == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ASSERT_GE(engine->heard().responses, 1u);
    float peak = 0, step = 0;
    const auto at = [&](std::size_t i) { return out.samples[2 * i]; };
    for (std::size_t i = 2000; i < out.frames(); ++i) {
        peak = std::max(peak, std::abs(at(i)));
        step = std::max(step, std::abs(at(i) - 3 * at(i - 1) + 3 * at(i - 2) - at(i - 3)));
    }
    EXPECT_LT(step, .01 * peak) << "after " << blocks << " blocks";
}

/// Sources that are heard without reflections are counted, and soon there are none: if several wait, each has an eighth
/// of its rays at first, and the rest later.
TEST(LiveSound, SourcesWithoutReflectionsAreCountedAndHurriedFor) {
    std::string text = kRoom;
    for (const char* x : {"2", "3"})
        text += std::string("Transform { translation ") + x +
                " 2 1 children SpatialSound { children OscillatorSource { frequency 300 } } }\n";
    Rendered room(text);
    AcousticOptions options = fewLive();
    options.background = true;
    auto engine = *AcousticEngine::create(options);
    SoundBuffer out;
    const auto renderUntil = [&](const auto& done) {
        for (int block = 0; !done() && block < 60'000; ++block) {
            EXPECT_TRUE(room.block(*engine, 0, out));
            out.samples.clear();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        return done();
    };
    const HeardResponses& heard = engine->heard();
    EXPECT_TRUE(renderUntil([&] { return heard.unreflected == 3; }));
    EXPECT_TRUE(renderUntil([&] { return heard.responses == 1; }));
    EXPECT_EQ(heard.rays, 56u) << "an eighth, as much for each batch";
    EXPECT_TRUE(renderUntil([&] { return heard.unreflected == 0; }));
    EXPECT_EQ(heard.rays, 400u) << "the last one is not waited for";
    EXPECT_GT(heard.longestWait, 0);
    // Each of the others looks for leaks once, with all rays; then all are as good, and nothing moves.
    EXPECT_TRUE(renderUntil([&] { return heard.responses >= 5; }));
    const double rests = engine->liveEnd() + 1;
    EXPECT_TRUE(renderUntil([&] { return engine->liveEnd() > rests; }));
    EXPECT_EQ(heard.responses, 5u);
}

TEST(LiveSound, ABackgroundResponseIsTheOneThatIsTracedInPlace) {
    Rendered room(kRoom);
    const auto sound = [&](bool background) {
        AcousticOptions options = fewLive();
        options.background = background;
        options.retraceSeconds = 100;
        auto engine = *AcousticEngine::create(options);
        SoundBuffer out;
        int block = 0;
        const auto render = [&](int blocks) {
            for (const int end = block + blocks; block < end; ++block) EXPECT_TRUE(room.block(*engine, 0, out));
        };
        render(1);
        while (engine->heard().responses == 0) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            if (!background) break;
            render(1);
        }
        render(400);
        EXPECT_EQ(engine->heard().responses, 1u);
        // A tone that has gone on for longer than the response: its level is that of the room.
        double energy = 0;
        for (std::size_t i = out.samples.size() - 2 * 48000 / 2; i < out.samples.size(); i += 2)
            energy += static_cast<double>(out.samples[i]) * static_cast<double>(out.samples[i]) / 24000;
        return energy;
    };
    const double inPlace = sound(false), beside = sound(true);
    EXPECT_GT(inPlace, .01);
    EXPECT_NEAR(beside / inPlace, 1, 1e-3);
}

}  // namespace
}  // namespace rtsg
