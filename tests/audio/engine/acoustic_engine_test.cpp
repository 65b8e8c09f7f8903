// The engine: renders from a version of the tables alone, and traces again what a change can reach.
#include <algorithm>
#include <cmath>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/shared_world.h>

#include "engine/acoustic_engine.h"
#include "response/reach.h"

namespace rtsg {
namespace {

/// A closed room with a sound and a listener in it, a box inside and a box outside.
const char* const kRooms =
    "#X3D V4.0 utf8\nPROFILE Full\n"
    "Transform { translation 3 2.5 1.5 children Shape { geometry Box { size 6 5 3 solid FALSE } } }\n"
    "DEF In Transform { translation 5 4 1 children Shape { geometry Box { size .4 .4 .4 } } }\n"
    "DEF Out Transform { translation 12 4 1 children Shape { geometry Box { size 2 2 2 } } }\n"
    "DEF Voice Transform { children Sound { location 1 1 1.5 minBack 30 minFront 30 maxBack 60 maxFront 60 source "
    "OscillatorSource { frequency 440 } } }\nDEF Eye Viewpoint { position 4 3 1.5 }\n";

/// Rays that can be frozen.
struct OwnRays final : InstanceSubscriber {
    RayWorld world;
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        world.apply(delta);
        return {};
    }
};

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
        for (int frame = 1; frame <= std::lround(seconds * 60); ++frame) {
            edit(frame);
            scene.newFrame(frame / 60.0);
            EXPECT_TRUE(engine.render(*tables.latest(), world.rays(), frame / 60.0, sound));
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

/// To look for the edges of a mesh takes longer than a block of sound, and only who traces needs them: the thread of
/// sound does not where another one traces.
TEST(AcousticEngine, LooksForEdgesOnlyWhereItTraces) {
    for (const bool background : {false, true}) {
        Stage stage;
        AcousticOptions options;
        options.background = background;
        const auto engine = AcousticEngine::create(options);
        ASSERT_TRUE(engine);
        int edges = 0;
        (*engine)
            ->geometryFor(*stage.tables.latest(), stage.world.rays(), {1, 1, 1.5})
            .visitEdges([&](const WallEdge&) { ++edges; });
        EXPECT_EQ(edges > 0, !background);
    }
}

TEST(AcousticEngine, GoesOnWhereTimeGoesBack) {
    Stage stage(
        "#X3D V4.0 utf8\nPROFILE Full\nAudioDestination { gain .5 children BufferAudioSource { startTime 1 sampleRate "
        "48000 loop TRUE buffer [ .5 ] } }\nViewpoint { }\n");
    auto engine = *AcousticEngine::create(few());
    SoundBuffer sound;
    const auto state = stage.tables.latest();
    for (const double t : {.9, 1.5, .5, 1.25, 2.}) ASSERT_TRUE(engine->render(*state, stage.world.rays(), t, sound));
    // From 0 to 1.5 and from .5 to 2.
    ASSERT_EQ(sound.frames(), 3 * 48000U);
    const auto at = [&](double seconds) { return sound.samples[2 * static_cast<std::size_t>(seconds * 48000)]; };
    EXPECT_EQ(at(.99), 0);
    for (const double t : {1.01, 1.49, 2.01, 2.99}) EXPECT_NEAR(at(t), .25, 1e-6) << t;
    EXPECT_EQ(at(1.52), 0) << "it starts at 1 again";
    EXPECT_EQ(at(1.99), 0);
}

TEST(AcousticEngine, TracesAgainOnlyWhatAChangeCanReach) {
    const auto traces = [](const auto& edit) {
        Stage stage;
        auto engine = *AcousticEngine::create(few());
        const SoundBuffer sound = stage.render(*engine, .8, [&](int frame) { edit(stage, frame); });
        return std::pair(engine->heard().responses, sound.samples);
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

/// Its effect on the response is smaller than that of other random rays.
TEST(AcousticEngine, WhatMovesFarOffAndIsSmallIsTracedOnceASecond) {
    Stage stage(
        "#X3D V4.0 utf8\nPROFILE Full\n"
        "Transform { translation 15 10 4 children Shape { geometry Box { size 30 20 8 solid FALSE } } }\n"
        "DEF In Transform { translation 28 18 1 children Shape { geometry Box { size .4 .4 .4 } } }\n"
        "DEF Voice Transform { children Sound { location 1 1 1.5 minBack 30 minFront 30 maxBack 60 maxFront 60 source "
        "OscillatorSource { frequency 440 } } }\nDEF Eye Viewpoint { position 4 3 1.5 }\n");
    auto engine = *AcousticEngine::create(few());
    stage.render(*engine, 2.5, [&](int frame) { stage.move("In", {28, 18, 1 + .01f * static_cast<float>(frame)}); });
    EXPECT_EQ(engine->heard().responses, 3u);
}

/// A head that turns traces nothing, and hears in the end what one does that was turned so from the start.
TEST(AcousticEngine, AHeadThatTurnsTracesNothing) {
    const auto heard = [](int turnedAt, bool live) {
        Stage stage;
        AcousticOptions options = few();
        auto engine = *AcousticEngine::create(options);
        const SoundBuffer sound = stage.render(*engine, .8, [&](int frame) {
            const NodeId eye = stage.scene.findName("Eye");
            if (frame == turnedAt) {
                ASSERT_TRUE(stage.scene.set(eye, x3d::Viewpoint::orientation, Rotation{0, 1, 0, 1.2f}));
            }
            if (frame > 1 && live) {  // every frame, by 6 degrees
                ASSERT_TRUE(stage.scene.set(eye, x3d::Viewpoint::orientation,
                                            Rotation{0, 1, 0, .1f * static_cast<float>(frame)}));
            }
        });
        return std::pair(engine->heard(), sound);
    };
    const auto before = heard(1, false), later = heard(20, false), never = heard(0, false), always = heard(0, true);
    EXPECT_EQ(before.first.responses, 1u);
    EXPECT_EQ(before.first.turned, 0u);
    EXPECT_EQ(later.first.responses, 1u);
    EXPECT_EQ(later.first.turned, 1u);
    EXPECT_EQ(later.first.rays, before.first.rays);
    EXPECT_EQ(always.first.responses, 1u);
    EXPECT_EQ(always.first.turned, 3u) << "every .2 s";
    double maximum = 0, other = 0;
    for (std::size_t i = 2 * 48000 * 6 / 10; i < later.second.samples.size(); ++i) {
        maximum = std::max(maximum, double{std::abs(later.second.samples[i] - before.second.samples[i])});
        other = std::max(other, double{std::abs(later.second.samples[i] - never.second.samples[i])});
    }
    EXPECT_LT(maximum, 1e-5 * before.second.peak());
    EXPECT_GT(other, .02 * before.second.peak());
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
    WorldGeometry geometry;
    geometry.follow(stage.tables.latest()->walls, stage.world.rays());
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
        for (const AcousticBox& box : geometry.follow(stage.tables.latest()->walls, stage.world.rays()).boxes)
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
    // Fifteen versions and nothing else; the scene has gone on, its walls moved, and is gone itself.
    struct Version {
        std::shared_ptr<const AcousticState> state;
        std::shared_ptr<const WorldVersion> rays;
    };
    std::vector<Version> versions;
    {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, kRooms, diagnostics));
        SharedWorld world(scene);
        OwnRays own;
        AcousticTables tables(own.world);
        world.add(own);
        world.add(tables);
        scene.newFrame(0);
        for (int frame = 1; frame <= 15; ++frame) {
            scene.newFrame(frame / 60.0);
            versions.push_back({tables.latest(), own.world.freeze()});
        }
        const Version& last = versions.back();
        ASSERT_TRUE(last.rays);
        EXPECT_EQ(tables.latest(), tables.latest());
        for (const char* name : {"Voice", "In"})
            ASSERT_TRUE(scene.set(scene.findName(name), x3d::Transform::translation, Vec3f(2, 2, 0)));
        scene.newFrame(1);
        EXPECT_NE(tables.latest()->sounds.emitters, last.state->sounds.emitters);
        EXPECT_GT(tables.latest()->sequence, last.state->sequence);
        world.remove(tables);
        world.remove(own);
    }
    SoundBuffer sound;
    std::thread([&] {
        auto second = *AcousticEngine::create(few());
        for (std::size_t i = 0; i < versions.size(); ++i)
            EXPECT_TRUE(
                second->render(*versions[i].state, *versions[i].rays, static_cast<double>(i + 1) / 60.0, sound));
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
    EXPECT_EQ(renderer->engine().heard().responses, engine->heard().responses);
    EXPECT_GT(sound.peak(), .01f);
}

TEST(AcousticEngine, QualityIsRaysAndCandidates) {
    const TraceOptions usual = AcousticOptions().trace, twice = AcousticOptions::heardTrace(2),
                       half = AcousticOptions::heardTrace(.5), maximum = AcousticOptions::heardTrace(16),
                       of = AcousticOptions::heardTraceOf(80);
    EXPECT_EQ(usual.rays, AcousticOptions::kHeardRays);
    EXPECT_EQ(twice.rays, 4 * usual.rays);
    EXPECT_EQ(half.rays, usual.rays / 4);
    EXPECT_EQ(of.rays, 80u);
    EXPECT_EQ(twice.maxImageCandidates, 4 * usual.maxImageCandidates);
    for (const TraceOptions& fewer : {half, of}) EXPECT_EQ(fewer.maxImageCandidates, usual.maxImageCandidates);
    EXPECT_EQ(maximum.maxImageCandidates, TraceOptions().maxImageCandidates) << "as figures have at most";
    Stage stage;
    AcousticOptions options;
    options.trace = AcousticOptions::heardTraceOf(4000);
    options.trace.maxSeconds = 1;
    auto engine = *AcousticEngine::create(options);
    stage.render(*engine, .1, [](int) {});
    EXPECT_EQ(engine->heard().responses, 1u);
    EXPECT_EQ(engine->heard().rays, 4000u);
}

/// Energies in 20 ms of both channels, from the second click on.
std::vector<double> energiesOf(const SoundBuffer& sound) {
    constexpr std::size_t kWindow = 960;
    std::vector<double> energies;
    for (std::size_t at = 24'000; at + kWindow <= sound.frames(); at += kWindow) {
        double sum = 0;
        for (std::size_t i = 2 * at; i < 2 * (at + kWindow); ++i)
            sum += static_cast<double>(sound.samples[i]) * static_cast<double>(sound.samples[i]);
        energies.push_back(sum);
    }
    return energies;
}

TEST(AcousticEngine, TheErrorOfWhatIsHeardFallsAsQualityRises) {
    std::string clicks;
    for (int i = 0; i < 24'000; ++i) clicks += i == 100 ? "1 " : "0 ";
    const std::string room =
        "#X3D V4.0 utf8\nPROFILE Full\nTransform { translation 1.5 1.2 1 children Shape { appearance Appearance { "
        "acousticProperties "
        "AcousticProperties { absorption .2 diffuse .4 specular .4 } } geometry Box { size 3 2.4 2 solid FALSE } } "
        "}\nDEF Voice Transform { children SpatialSound { location 1 1 .5 dopplerEnabled TRUE children "
        "BufferAudioSource { sampleRate 48000 loop TRUE buffer [ " +
        clicks + "] } } }\nListenerPointSource { position 2.3 1.5 1.5 }\n";
    const auto heardWith = [&](double quality) {
        Stage stage(room.c_str());
        AcousticOptions options;
        options.trace = AcousticOptions::heardTrace(quality);
        options.trace.maxSeconds = 1;
        auto engine = *AcousticEngine::create(options);
        return energiesOf(stage.render(
            *engine, 1.5, [&](int frame) { stage.move("Voice", {static_cast<float>(.008 * frame), 0, 0}); }));
    };
    const std::vector<double> right = heardWith(8);
    const auto errorOf = [&](double quality) {
        const std::vector<double> heard = heardWith(quality);
        const double minimum = 1e-4 * *std::ranges::max_element(right);
        double squares = 0, count = 0;
        for (std::size_t k = 0; k < heard.size(); ++k) {
            if (right[k] < minimum) continue;
            squares += std::pow(10 * std::log10(heard[k] / right[k]), 2);
            ++count;
        }
        return std::sqrt(squares / count);
    };
    const double low = errorOf(.25), usual = errorOf(1), high = errorOf(4);
    EXPECT_LT(usual, .6 * low) << usual << " " << high;
    EXPECT_LT(high, .6 * usual);
    EXPECT_LT(high, .3) << "dB";
}

/// To look for leaks takes all rays, so that nothing would be kept: in a closed room it is done once, and again only
/// metres farther on.
TEST(AcousticEngine, WhereNothingLeaksLateSoundIsAMeanOfFewRaysEach) {
    Stage stage;
    auto engine = *AcousticEngine::create(few());
    stage.render(*engine, 2, [&](int frame) { stage.move("Voice", {static_cast<float>(.015 * frame), 0, 0}); });
    EXPECT_GE(engine->heard().responses, 8u);
    EXPECT_EQ(engine->heard().rays, 400u);
    EXPECT_LT(engine->heard().raysInAll, 400 + 60 * engine->heard().responses);
    Stage far;
    engine = *AcousticEngine::create(few());
    far.render(*engine, 2, [&](int frame) { far.move("Voice", {static_cast<float>(.035 * frame), 0, 0}); });
    EXPECT_GT(engine->heard().raysInAll, 2 * 400 + 40 * (engine->heard().responses - 2)) << "once more, two metres on";
}

}  // namespace
}  // namespace rtsg
