// The engine: renders from a version of the tables alone, and traces again what a change can reach.
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/audio/acoustic_engine.h>
#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/core/loader.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/shared_world.h>

#include "reach.h"

namespace rtsg {
namespace {

/// A closed room with a sound and a listener in it, a box inside and a box outside.
const char* const kRooms =
    "#X3D V4.0 utf8\nPROFILE Full\n"
    "Transform { translation 3 2.5 1.5 children Shape { geometry Box { size 6 5 3 solid FALSE } } }\n"
    "DEF In Transform { translation 5 4 1 children Shape { geometry Box { size .4 .4 .4 } } }\n"
    "DEF Out Transform { translation 12 4 1 children Shape { geometry Box { size 2 2 2 } } }\n"
    "DEF Voice Transform { children Sound { location 1 1 1.5 minBack 30 minFront 30 maxBack 60 maxFront 60 source "
    "OscillatorSource { frequency 440 } } }\nViewpoint { position 4 3 1.5 }\n";

struct Stage {
    explicit Stage(const char* text = kRooms) {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene, text, diagnostics));
        world.add(tables);
        scene.newFrame(0);
    }
    void move(const char* name, const Vec3f& to) {
        ASSERT_TRUE(scene.set(scene.findName(name), x3d::Transform::translation, to));
    }
    /// Sound of `seconds`, at 60 frames a second, with `edit` before each.
    template <class Edit>
    SoundBuffer render(AcousticEngine& engine, double seconds, const Edit& edit) {
        SoundBuffer sound;
        const RaysOf rays(world.rays());
        for (int frame = 1; frame <= std::lround(seconds * 60); ++frame) {
            edit(frame);
            scene.newFrame(frame / 60.0);
            EXPECT_TRUE(engine.render(*tables.latest(), rays, frame / 60.0, sound));
        }
        return sound;
    }

    Scene scene;
    SharedWorld world{scene};
    AcousticTables tables{world.rays()};
};

AcousticOptions few() {
    AcousticOptions options;
    options.trace.rays = 400;
    options.trace.maxSeconds = 1;
    return options;
}

TEST(AcousticEngine, TracesAgainOnlyWhatAChangeCanReach) {
    const auto traces = [](const auto& edit) {
        Stage stage;
        auto engine = *AcousticEngine::create(few());
        const SoundBuffer sound = stage.render(*engine, .8, [&](int frame) { edit(stage, frame); });
        return std::pair(engine->traces(), sound.samples);
    };
    const auto still = traces([](Stage&, int) {});
    const auto outside =
        traces([](Stage& stage, int frame) { stage.move("Out", {12 + .1f * static_cast<float>(frame), 4, 1}); });
    const auto inside =
        traces([](Stage& stage, int frame) { stage.move("In", {5, 4, 1 + .01f * static_cast<float>(frame)}); });
    const auto through = traces([](Stage& stage, int frame) {
        if (frame == 30) stage.move("Out", {3, 4, 1});
    });
    EXPECT_EQ(still.first, 1u);
    EXPECT_EQ(outside.first, 1u);
    EXPECT_EQ(outside.second, still.second);
    EXPECT_EQ(inside.first, 4u);  // every .2 s
    EXPECT_EQ(through.first, 2u);
    EXPECT_NE(through.second, still.second);
}

TEST(AcousticEngine, WhatCannotBeReachedChangesNoPath) {
    constexpr std::uint64_t kSeed = 8;
    SCOPED_TRACE(kSeed);
    std::mt19937_64 random(kSeed);
    std::uniform_real_distribution<double> unit(-1, 1);
    const auto somewhere = [&] {
        return Vec3f(glm::dvec3(3 + 5 * unit(random), 2.5 + 5 * unit(random), 1.5 + 5 * unit(random)));
    };
    Stage stage;
    const glm::dvec3 source(1, 1, 1.5), listener(4, 3, 1.5);
    TraceOptions options;
    options.rays = 200;
    options.imageOrder = 2;
    options.maxSeconds = 1;
    const double longest = options.maxSeconds * options.air.speedOfSound;
    const RaysOf rays(stage.world.rays());
    WorldGeometry geometry;
    geometry.follow(stage.tables.latest()->walls, rays);
    const auto trace = [&](AcousticBox& reached) {
        const ReachRecorder recorder(geometry, longest);
        TraceResult result = AcousticTracer(recorder).trace(source, listener, options);
        reached = recorder.reached();
        reached.extend(listener - .6);
        reached.extend(listener + .6);
        return result;
    };
    AcousticBox reached;
    TraceResult before = trace(reached);
    int same = 0, other = 0;
    for (int step = 1; step <= 40; ++step) {
        stage.move(step % 3 ? "Out" : "In", somewhere());
        stage.scene.newFrame(step / 60.0);
        bool reaches = false;
        for (const AcousticBox& box : geometry.follow(stage.tables.latest()->walls, rays).boxes)
            reaches = reaches || mayReach(reached, source, listener, longest, box);
        const TraceResult now = trace(reached);
        if (!reaches) {
            ++same;
            ASSERT_EQ(now.receiverRadius, before.receiverRadius);
            ASSERT_EQ(now.arrivals.size(), before.arrivals.size());
            for (std::size_t i = 0; i < now.arrivals.size(); ++i)
                ASSERT_EQ(now.arrivals[i].energy, before.arrivals[i].energy);
            for (std::size_t i = 0; i < now.batches.size(); ++i)
                ASSERT_EQ(now.batches[i].bins, before.batches[i].bins) << "step " << step;
        } else {
            ++other;
        }
        before = now;
    }
    EXPECT_GT(same, 5);
    EXPECT_GT(other, 5);
}

TEST(AcousticEngine, BeyondTheLongestPathNothingIsHeard) {
    AcousticBox everywhere;
    everywhere.extend(glm::dvec3(-1e4));
    everywhere.extend(glm::dvec3(1e4));
    const auto at = [](double x) {
        AcousticBox box;
        box.extend(glm::dvec3(x, 0, 0));
        box.extend(glm::dvec3(x + 1, 1, 1));
        return box;
    };
    // There and back is 343 m from 171.5 on.
    EXPECT_TRUE(mayReach(everywhere, {0, 0, 0}, {0, 0, 0}, 343, at(171)));
    EXPECT_FALSE(mayReach(everywhere, {0, 0, 0}, {0, 0, 0}, 343, at(172)));
    EXPECT_TRUE(mayReach(everywhere, {0, 0, 0}, {100, 0, 0}, 343, at(220)));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(mayReach(everywhere, {0, 0, 0}, {0, 0, 0}, 343, at(nan)));
}

TEST(AcousticEngine, AVersionSoundsTheSameOnAnotherThreadWhileTheSceneIsEdited) {
    const auto silence = [](int) {};
    Stage quiet;
    auto first = *AcousticEngine::create(few());
    const SoundBuffer expected = quiet.render(*first, .25, silence);
    // Fifteen versions and nothing else; the scene has long gone on, and the tables are gone. The walls stand still:
    // the live rays do.
    std::vector<std::shared_ptr<const AcousticState>> states;
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kRooms, diagnostics));
    SharedWorld world(scene);
    {
        AcousticTables tables(world.rays());
        world.add(tables);
        scene.newFrame(0);
        for (int frame = 1; frame <= 15; ++frame) {
            scene.newFrame(frame / 60.0);
            states.push_back(tables.latest());
        }
        ASSERT_TRUE(scene.set(scene.findName("Voice"), x3d::Transform::translation, Vec3f(2, 2, 0)));
        scene.newFrame(1);
        EXPECT_NE(tables.latest()->sounds.emitters, states.back()->sounds.emitters);
        EXPECT_GT(tables.latest()->sequence, states.back()->sequence);
        EXPECT_EQ(tables.latest(), tables.latest());
        world.remove(tables);
    }
    SoundBuffer sound;
    std::thread([&] {
        auto second = *AcousticEngine::create(few());
        const RaysOf rays(world.rays());
        for (std::size_t i = 0; i < states.size(); ++i)
            EXPECT_TRUE(second->render(*states[i], rays, static_cast<double>(i + 1) / 60.0, sound));
    }).join();
    EXPECT_EQ(sound.samples, expected.samples);
}

TEST(AcousticEngine, TheRendererIsTheTwoPartsTogether) {
    const auto edit = [](Stage& stage, int frame) {
        stage.move("Voice", {.05f * static_cast<float>(frame), 0, 0});
        stage.move("In", {5, 4, 1 + .01f * static_cast<float>(frame)});
    };
    Stage parts;
    auto engine = *AcousticEngine::create(few());
    const SoundBuffer apart = parts.render(*engine, .5, [&](int frame) { edit(parts, frame); });

    Stage whole;
    auto renderer = *AcousticRenderer::create(whole.world.rays(), few());
    whole.world.add(*renderer);
    SoundBuffer sound;
    for (int frame = 1; frame <= 30; ++frame) {
        edit(whole, frame);
        whole.scene.newFrame(frame / 60.0);
        ASSERT_TRUE(renderer->render(frame / 60.0, sound));
    }
    EXPECT_EQ(sound.samples, apart.samples);
    EXPECT_EQ(renderer->traces(), engine->traces());
    EXPECT_GT(sound.peak(), .01f);
}

}  // namespace
}  // namespace rtsg
