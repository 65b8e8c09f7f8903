// Listening as a user asks for it: reports, files, edits on the way, and what is missing or absurd.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include <fmt/format.h>

#include <rtsg/documents/resource_check.h>

#include "listen_scene.h"

namespace rtsg {
namespace {

using namespace test;

namespace fs = std::filesystem;

TEST_F(Listen, ErrorAsksForAsManyRaysAsItTakes) {
    Scene scene;
    load(scene, room("absorption .3 diffuse .3 specular .4", kPair));
    ListenOptions o = options();
    o.sound = false;
    o.metrics = true;
    o.trace.rays = 200;
    o.error = 0.5;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    const auto& m = report->sources[0].metrics;
    EXPECT_GT(report->rays, 400u);
    for (std::size_t b = 1; b < 7; ++b) {
        EXPECT_LE(m.ci95.t20[b], 0.5 * 0.05 * m.value.t20[b]);
        EXPECT_LE(m.ci95.c80[b], 0.5);
    }
}

TEST_F(Listen, TheReportSaysWhatWasUsedForWhatIsHeard) {
    Scene scene;
    load(scene, room("absorption .3 diffuse .3 specular .4", kPair));
    ListenOptions o = options();
    o.render.trace = AcousticOptions::heardTraceOf(3200);
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->heard.responses, 1u);
    EXPECT_EQ(report->heard.rays, 3200u);
    EXPECT_GT(report->heard.images, 100u);
    EXPECT_NE(report->toJson().find(
                  fmt::format("\"heard\":{{\"responses\":1,\"rays\":3200,\"images\":{}}}}}", report->heard.images)),
              std::string::npos)
        << report->toJson();
}

TEST_F(Listen, FollowsEditsOfTheScene) {
    Scene scene;
    load(scene,
         "DEF Voice Sound { location 1 0 0 source AudioClip { url \"tone.wav\" loop TRUE } }\nViewpoint { position 0 0 "
         "0 }\n");
    ListenOptions o = options();
    SharedWorld world(scene);
    SoundRenderer listening(world, o);
    ASSERT_EQ(listening.failure(), "");
    scene.newFrame(0);
    const NodeId voice = scene.findName("Voice");
    ASSERT_TRUE(voice);
    scene.newFrame(0.1);
    ASSERT_TRUE(listening.renderFrame());
    ASSERT_TRUE(scene.set(voice, x3d::Sound::enabled, false));
    scene.newFrame(0.2);
    ASSERT_TRUE(listening.renderFrame());
    ASSERT_TRUE(scene.set(voice, x3d::Sound::enabled, true));
    ASSERT_TRUE(scene.set(voice, x3d::Sound::location, Vec3f(-1, 0, 0)));
    scene.newFrame(0.3);
    ASSERT_TRUE(listening.renderFrame());
    ASSERT_TRUE(scene.destroyNode(voice));
    for (const double t : {0.4, 0.5}) {
        scene.newFrame(t);
        ASSERT_TRUE(listening.renderFrame());
    }
    const SoundBuffer sound = listening.finish().sound;
    ASSERT_EQ(sound.frames(), static_cast<std::size_t>(0.5 * kRate));
    const auto energy = [&](double from, double to, std::size_t channel) {
        double sum = 0;
        for (auto i = static_cast<std::size_t>(from * kRate); i < static_cast<std::size_t>(to * kRate); ++i)
            sum += sound.samples[2 * i + channel] * sound.samples[2 * i + channel];
        return sum;
    };
    EXPECT_GT(energy(.02, .2, 1), 4 * energy(.02, .2, 0)) << "until the frame that disables it";
    EXPECT_NEAR(energy(.22, .3, 0) + energy(.22, .3, 1), 0, 1e-6);
    EXPECT_GT(energy(.38, .4, 0), 4 * energy(.38, .4, 1));
    EXPECT_NEAR(energy(.43, .5, 0) + energy(.43, .5, 1), 0, 1e-6);
}

/// However few frames there are, nothing is heard before it happens, nor later than a block.
TEST_F(Listen, WhatIsEditedIsHeardFromThenOn) {
    for (const double fps : {60., 10., 2.}) {
        Scene scene;
        load(scene,
             "DEF Out AudioDestination { gain 0 children OscillatorSource { frequency 480 } }\nDEF Held Group { "
             "children DEF Own AudioDestination { children OscillatorSource { frequency 960 } } }\nViewpoint { }\n");
        const NodeId out = scene.findName("Out"), held = scene.findName("Held");
        ListenOptions o = options();
        o.seconds = 2;
        o.framesPerSecond = fps;
        o.runTo = [&](double t) {
            const bool done = t == .5  ? scene.destroyNode(held).has_value()
                              : t == 1 ? scene.set(out, x3d::AudioDestination::gain, .5f).has_value()
                                       : t != 1.5 || scene.set(out, x3d::AudioDestination::enabled, false).has_value();
            EXPECT_TRUE(done) << t;
            scene.newFrame(t);
        };
        const auto report = listen(scene, o);
        ASSERT_TRUE(report) << report.error().text;
        const auto loudest = [&](double from, double to) {
            float maximum = 0;
            for (auto i = std::lround(from * kRate); i < std::lround(to * kRate); ++i)
                maximum = std::max(maximum, std::abs(report->sound.samples[2 * static_cast<std::size_t>(i)]));
            return maximum / report->gain;
        };
        const double block = 256. / kRate;
        EXPECT_NEAR(loudest(.49, .5), 1, .01) << fps;
        EXPECT_EQ(loudest(.5 + 2 * block, 1), 0) << fps;
        EXPECT_NEAR(loudest(1 + 2 * block, 1.5), .5, .01) << fps;
        EXPECT_NEAR(loudest(1.49, 1.5), .5, .01) << fps;
        EXPECT_EQ(loudest(1.5 + 2 * block, 2), 0) << fps;
    }
}

TEST_F(Listen, AClipBesideAnInlinedFileIsFound) {
    fs::create_directories(folder_ / "parts" / "sounds");
    SoundBuffer loud{kRate, 1, std::vector<float>(kRate / 10, .5f)};
    ASSERT_TRUE(writeWav((folder_ / "parts" / "sounds" / "beside.wav").string(), loud, WavFormat::float32));
    std::ofstream(folder_ / "parts" / "inner.x3dv")
        << "#X3D V4.0 utf8\nPROFILE Full\nSound { location 0 0 -3 minBack 9 minFront 9 source AudioClip { loop "
           "TRUE url \"sounds/beside.wav\" } }\n";
    std::ofstream(folder_ / "outer.x3dv")
        << "#X3D V4.0 utf8\nPROFILE Full\nInline { url \"parts/inner.x3dv\" }\nViewpoint { position 0 0 0 }\n";
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, (folder_ / "outer.x3dv").string(), diagnostics));
    const auto report = listen(scene, options());
    ASSERT_TRUE(report);
    for (const Diagnostic& d : report->diagnostics.all()) ADD_FAILURE() << d.format();
    EXPECT_NEAR(report->sound.samples[2 * 2000], .5f, 1e-3);
    // And without saying where urls start.
    ListenOptions plain;
    plain.seconds = .2;
    plain.metrics = false;
    plain.render.resources = Resources::ofFile((folder_ / "outer.x3dv").string());
    const auto again = listen(scene, plain);
    ASSERT_TRUE(again);
    for (const Diagnostic& d : again->diagnostics.all()) ADD_FAILURE() << d.format();
}

TEST_F(Listen, AnAudioDestinationAtTheRootIsHeard) {
    Scene scene;
    load(scene,
         "DEF Out AudioDestination { gain .5 children OscillatorSource { frequency 480 } }\n"
         "Viewpoint { position 500 0 0 }\n" +
             room("absorption .1", ""));
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    scene.newFrame(0);
    scene.newFrame(.1);
    ASSERT_TRUE(sound.renderFrame());
    for (std::size_t i = 0; i < 4800; ++i)
        for (std::size_t c = 0; c < 2; ++c)
            ASSERT_NEAR(sound.block()[2 * i + c], .5 * std::sin(2 * M_PI * 480 * static_cast<double>(i) / kRate), 1e-5)
                << i;
    ASSERT_TRUE(scene.set(scene.findName("Out"), x3d::AudioDestination::gain, .25f));
    for (const double t : {.2, .3}) {
        scene.newFrame(t);
        ASSERT_TRUE(sound.renderFrame());
    }
    EXPECT_NEAR(*std::max_element(sound.block().begin() + 4000, sound.block().end()), .25f, 1e-3);
    EXPECT_TRUE(sound.finish().diagnostics.all().empty());
}

TEST_F(Listen, WhatLeadsIntoAStreamDestinationIsKeptAndNotHeard) {
    Scene scene;
    load(scene,
         "DEF Out StreamAudioDestination { gain .5 streamIdentifier [ \"desk\" \"truck\" ] children [ DEF One "
         "OscillatorSource "
         "{ frequency 480 } ChannelMerger { children [ Gain { gain 0 children OscillatorSource { } } Gain { gain .25 "
         "children "
         "OscillatorSource { frequency 480 } } ] } ] }\n"
         "DEF Held Group { children [ USE Out DEF Late StreamAudioDestination { enabled FALSE children "
         "OscillatorSource { "
         "frequency 480 } } ] }\nViewpoint { }\n");
    ListenOptions o = options();
    o.render.keepStreams = true;
    SharedWorld world(scene);
    SoundRenderer sound(world, o);
    scene.newFrame(.1);
    ASSERT_TRUE(sound.renderFrame());
    for (const float sample : sound.block()) ASSERT_EQ(sample, 0);
    // An edit is heard from its frame on, so it ends no sound.
    const auto now = [&] {
        scene.seal();
        ASSERT_TRUE(sound.renderFrame());
    };
    ASSERT_TRUE(scene.set(scene.findName("Late"), x3d::StreamAudioDestination::enabled, true));
    now();
    scene.newFrame(.2);
    ASSERT_TRUE(sound.renderFrame());
    ASSERT_TRUE(scene.destroyNode(scene.findName("Held")));
    now();
    scene.newFrame(.3);
    ASSERT_TRUE(sound.renderFrame());
    const ListenReport report = sound.finish();
    EXPECT_TRUE(report.diagnostics.all().empty());
    ASSERT_EQ(report.streams.size(), 2u);
    const StreamedSound& out = report.streams[0];
    EXPECT_EQ(out.name, "Out");
    EXPECT_EQ(out.identifiers, (std::vector<std::string>{"desk", "truck"}));
    ASSERT_EQ(out.sound.channels, 2);
    ASSERT_EQ(out.sound.frames(), 14400u) << "as long as what is heard, though it stands in two places";
    const auto tone = [](std::size_t i) { return .5 * std::sin(2 * M_PI * 480 * static_cast<double>(i) / kRate); };
    for (std::size_t i = 0; i < 14400; ++i) {
        ASSERT_NEAR(out.sound.samples[2 * i], tone(i), 1e-5) << i;
        ASSERT_NEAR(out.sound.samples[2 * i + 1], 1.25 * tone(i), 1e-5) << i;
    }
    const StreamedSound& late = report.streams[1];
    ASSERT_EQ(late.sound.channels, 1);
    ASSERT_EQ(late.sound.frames(), 14400u);
    double loudest = 0, before = 0, after = 0;
    for (std::size_t i = 0; i < 14400; ++i) {
        double& part = i < 4800 - 256 ? before : i < 9600 + 256 ? loudest : after;
        part = std::max<double>(part, std::abs(late.sound.samples[i]));
    }
    EXPECT_EQ(before, 0);
    EXPECT_NEAR(loudest, 1, 1e-3);
    EXPECT_EQ(after, 0) << "its node is gone";
}

TEST_F(Listen, AStreamDestinationThatNobodyAskedForIsNamed) {
    Scene scene;
    load(scene,
         "DEF Out StreamAudioDestination { children OscillatorSource { } }\n"
         "DEF Own AudioDestination { children OscillatorSource { frequency 480 } }\nViewpoint { }\n");
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    scene.newFrame(.1);
    ASSERT_TRUE(sound.renderFrame());
    ASSERT_TRUE(scene.destroyNode(scene.findName("Out")));
    scene.newFrame(.2);
    ASSERT_TRUE(sound.renderFrame());
    for (const float sample : sound.block()) ASSERT_TRUE(std::isfinite(sample));
    const ListenReport report = sound.finish();
    EXPECT_TRUE(report.streams.empty());
    ASSERT_EQ(report.diagnostics.all().size(), 1u);
    EXPECT_NE(report.diagnostics.all()[0].text.find("StreamAudioDestination Out is heard by nobody"),
              std::string::npos);
}

TEST_F(Listen, AStreamSourceWithTheNameOfAFilePlaysIt) {
    Scene scene;
    load(scene,
         "AudioDestination { children StreamAudioSource { gain .5 startTime .05 streamIdentifier [ \"gone.wav\" "
         "\"impulse.wav\" ] } }\nViewpoint { }\n");
    const ListenOptions o = options();
    SharedWorld world(scene);
    SoundRenderer sound(world, o);
    scene.newFrame(.1);
    ASSERT_TRUE(sound.renderFrame());
    for (std::size_t i = 0; i < sound.block().size(); ++i)
        ASSERT_NEAR(sound.block()[i], i / 2 == 2400 ? .25 : 0, 1e-6) << i;
    EXPECT_TRUE(sound.finish().diagnostics.all().empty());
    // Nothing that is made of the scene may take its place.
    const auto used = resourceFiles(scene, o.render.resources);
    EXPECT_EQ(
        std::count_if(used.begin(), used.end(), [](const auto& path) { return path.filename() == "impulse.wav"; }), 1);
}

TEST_F(Listen, MicrophonesHearWhatTheUserSaysAndNothingElse) {
    const auto hear = [&](const ClipLibrary::GivenSounds& microphones, Diagnostics& said) {
        Scene scene;
        load(scene,
             "AudioDestination { children [ MicrophoneSource { startTime .05 mediaDeviceID \"left\" } MicrophoneSource "
             "{ "
             "gain .5 startTime .05 mediaDeviceID \"impulse.wav\" } ] }\nViewpoint { }\n");
        ListenOptions o = options();
        o.render.given.microphones = microphones;
        SharedWorld world(scene);
        SoundRenderer sound(world, o);
        scene.newFrame(.1);
        EXPECT_TRUE(sound.renderFrame());
        std::vector<float> heard;
        for (std::size_t i = 0; i < sound.block().size(); i += 2) heard.push_back(sound.block()[i]);
        said.append(sound.finish().diagnostics);
        return heard;
    };
    Diagnostics none, one, all;
    EXPECT_EQ(std::ranges::count(hear({}, none), 0.0f), 4800) << "its name is nobody's file";
    EXPECT_EQ(none.warnings(), 2u) << "each is told";
    const auto ramp = std::make_shared<SoundBuffer>(SoundBuffer{kRate, 1, {}});
    for (int i = 0; i < 100; ++i) ramp->samples.push_back(static_cast<float>(i) / 128);
    const std::vector<float> left = hear({{"left", ramp}}, one);
    for (std::size_t i = 0; i < 4800; ++i)
        ASSERT_NEAR(left[i], i >= 2400 && i < 2500 ? static_cast<float>(i - 2400) / 128 : 0, 1e-6) << i;
    EXPECT_EQ(one.warnings(), 1u);
    const std::vector<float> both = hear({{"", ramp}}, all);
    EXPECT_NEAR(both[2450], 1.5 * 50 / 128, 1e-6) << "whatever they are called";
    EXPECT_EQ(all.warnings(), 0u);
}

/// Nodes that began long ago: a microphone and a stream bring what they bring now.
TEST_F(Listen, WhatTheUserGivesBeginsWhenItIsFirstHeard) {
    const auto ramp = std::make_shared<SoundBuffer>(SoundBuffer{kRate, 1, {}});
    for (int i = 0; i < 100; ++i) ramp->samples.push_back(static_cast<float>(i + 1) / 128);
    for (const std::string node : {"MicrophoneSource { }", "StreamAudioSource { streamIdentifier \"feed\" }"}) {
        Scene scene;
        load(scene, "AudioDestination { children " + node + " }\nViewpoint { }\n");
        scene.newFrame(1000);
        ListenOptions o = options();
        o.render.given.microphones[""] = ramp;
        o.render.given.streams["feed"] = ramp;
        SharedWorld world(scene);
        SoundRenderer sound(world, o);
        scene.newFrame(1000.1);
        ASSERT_TRUE(sound.renderFrame());
        for (std::size_t i = 0; i < 200; ++i)
            ASSERT_NEAR(sound.block()[2 * i], i < 100 ? static_cast<float>(i + 1) / 128 : 0, 1e-6) << node << i;
        EXPECT_TRUE(sound.finish().diagnostics.all().empty());
    }
}

TEST_F(Listen, ImpulseResponsesHaveTheChannelsAskedFor) {
    using Channels = ImpulseResponseOptions::Channels;
    Scene scene;
    load(scene, room("absorption .3 diffuse .3 specular .4",
                     "DEF A Sound { location 5.5 3 1.5 source AudioClip { url \"impulse.wav\" } }\n"
                     "DEF B Sound { location 4 3 .5 source AudioClip { url \"impulse.wav\" } }\n"
                     "Viewpoint { position 4 3 1.5 }\n"));
    ListenOptions o = options();
    o.sound = false;
    o.metrics = true;
    o.trace.rays = 480;
    const auto response = [&](Channels channels, int order) {
        o.responses = channels;
        o.render.ambisonicOrder = order;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        return report->impulseResponses();
    };
    const auto peak = [](const SoundBuffer& sound, std::size_t channel) {
        const auto channels = static_cast<std::size_t>(sound.channels);
        std::size_t best = 0;
        for (std::size_t i = 0; i < 300; ++i)
            if (std::abs(sound.samples[i * channels + channel]) > std::abs(sound.samples[best * channels + channel]))
                best = i;
        return std::pair(best, static_cast<double>(sound.samples[best * channels + channel]));
    };
    EXPECT_EQ(response(Channels::mono, 0).channels, 2);  // two sources
    const SoundBuffer stereo = response(Channels::stereo, 0);
    ASSERT_EQ(stereo.channels, 4);
    // A is 1.5 m to the right.
    EXPECT_NEAR(peak(stereo, 1).second / peak(stereo, 0).second, std::sqrt(1.9 / .1), .1);
    EXPECT_NEAR(peak(stereo, 3).second / peak(stereo, 2).second, 1, .01);  // each side has late noise of its own
    const SoundBuffer ears = response(Channels::binaural, 0);
    ASSERT_EQ(ears.channels, 4);
    EXPECT_NEAR(static_cast<double>(peak(ears, 0).first) - static_cast<double>(peak(ears, 1).first),
                .0875 / 343 * (1 + M_PI / 2) * kRate, 1.5);
    const SoundBuffer field = response(Channels::ambisonic, 2);
    ASSERT_EQ(field.channels, 18);
    EXPECT_NEAR(peak(field, 1).second / peak(field, 0).second, -1, .05);     // Y: left
    EXPECT_NEAR(peak(field, 9 + 3).second / peak(field, 9).second, 1, .05);  // X: ahead
}

TEST_F(Listen, ANodeRendererAddsTheVoiceOfItsNodes) {
    Scene scene;
    load(scene, "DEF Bell WorldInfo { title \"bell\" }\nViewpoint { position 0 0 0 }\n");
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    int called = 0;
    double end = 0;
    sound.registerNodeRenderer(
        "WorldInfo", nodeRendererFor<SoundRenderer>([&](SoundRenderer& s, const Node& node, Operation o) -> Result<> {
            EXPECT_EQ(o, SoundRenderer::kVoice);
            EXPECT_EQ(scene.name(node.id()), "Bell");
            EXPECT_NEAR(s.blockStart(), end, 1e-9);
            const auto channels = static_cast<std::size_t>(s.channels());
            end += static_cast<double>(s.block().size() / channels) / s.sampleRate();
            for (float& sample : s.block()) sample += .25f;
            ++called;
            return {};
        }));
    for (int frame = 1; frame <= 4; ++frame) {
        scene.newFrame(frame * .05);
        ASSERT_TRUE(sound.renderFrame());
    }
    EXPECT_EQ(called, 4);
    const SoundBuffer heard = sound.finish().sound;
    ASSERT_EQ(heard.frames(), static_cast<std::size_t>(.2 * kRate));
    for (const float sample : heard.samples) ASSERT_FLOAT_EQ(sample, .25f);
}

TEST_F(Listen, TheSameSceneGivesTheSameSamples) {
    std::vector<SoundBuffer> sounds;
    for (int i = 0; i < 2; ++i) {
        Scene scene;
        load(scene,
             room("absorption .3 diffuse .3 specular .4",
                  "DEF Move Transform { children " + kPair.substr(0, kPair.find('\n')) +
                      " }\n"
                      "DEF Clock TimeSensor { cycleInterval 1 loop TRUE }\n"
                      "DEF Way PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0 3 1 0 ] }\n"
                      "ROUTE Clock.fraction_changed TO Way.set_fraction\nROUTE Way.value_changed TO Move.translation\n"
                      "Viewpoint { position 4 3 1.5 }\n"));
        ListenOptions o = options();
        o.seconds = 0.5;
        o.render.binaural = true;
        const auto report = listen(scene, o);
        ASSERT_TRUE(report);
        sounds.push_back(report->sound);
    }
    EXPECT_EQ(sounds[0].samples, sounds[1].samples);
    EXPECT_GT(sounds[0].peak(), 0.01f);
}

TEST_F(Listen, WhatIsMissingIsSaid) {
    Scene silent;
    load(silent, "Viewpoint { }");
    const auto nothing = listen(silent, options());
    ASSERT_TRUE(nothing);
    EXPECT_EQ(nothing->diagnostics.warnings(), 1u);
    EXPECT_EQ(nothing->sound.frames(), 9600u);
    EXPECT_EQ(nothing->sound.peak(), 0.0f);

    // A scene whose sounds were heard for a while is not one without sounds.
    Scene passing;
    load(passing, "DEF Out AudioDestination { children OscillatorSource { } }\nViewpoint { }");
    ListenOptions ends = options();
    ends.runTo = [&](double t) {
        const NodeId out = passing.findName("Out");
        EXPECT_TRUE(t < .1 || !out || passing.destroyNode(out));
        passing.newFrame(t);
    };
    const auto passed = listen(passing, ends);
    ASSERT_TRUE(passed);
    EXPECT_EQ(passed->diagnostics.warnings(), 0u);
    EXPECT_TRUE(passed->diagnostics.all().empty());

    Scene missing;
    load(missing,
         "Sound { source AudioClip { description \"none\" url [ \"no.wav\" \"http://example.org/x.wav\" ] } "
         "}\nViewpoint { position 0 0 1 }");
    const auto unheard = listen(missing, options());
    ASSERT_TRUE(unheard);
    ASSERT_EQ(unheard->diagnostics.warnings(), 1u);
    EXPECT_NE(unheard->diagnostics.all()[0].text.find("no.wav"), std::string::npos);
    EXPECT_EQ(unheard->sound.peak(), 0);

    ListenOptions bad = options();
    bad.seconds = -1;
    EXPECT_FALSE(listen(silent, bad));
    bad = options();
    bad.render.sampleRate = 3;
    EXPECT_FALSE(listen(silent, bad));
}

TEST_F(Listen, ProgressGrowsAndFalseEndsItWithAnError) {
    Scene scene;
    load(scene, kPair);
    ListenOptions asked = options();
    double last = 0;
    int calls = 0;
    asked.progress = [&](double fraction) {
        EXPECT_GE(fraction, last);
        EXPECT_LE(fraction, 1);
        last = fraction;
        return ++calls < 1000;
    };
    ASSERT_TRUE(listen(scene, asked));
    EXPECT_GT(calls, 3);
    asked.progress = [](double) { return false; };
    EXPECT_FALSE(listen(scene, asked));
}

/// With so many rays that nobody would wait for them.
TEST_F(Listen, WhoFollowsTheProgressMayEndTracingAtAnyTime) {
    Scene scene;
    load(scene, kPair);
    ListenOptions asked = options();
    asked.sound = false;
    asked.metrics = true;
    asked.trace.rays = std::uint64_t{1} << 40;
    asked.trace.maxSeconds = .1;
    const std::thread::id self = std::this_thread::get_id();
    int calls = 0;
    asked.progress = [&](double) {
        EXPECT_EQ(std::this_thread::get_id(), self);
        return ++calls < 5;
    };
    const auto heard = listen(scene, asked);
    ASSERT_FALSE(heard);
    EXPECT_EQ(heard.error().text, "cancelled");
    EXPECT_EQ(calls, 5);
    calls = 0;
    SharedWorld world(scene);
    SoundRenderer sound(world, asked);
    EXPECT_FALSE(sound.survey());
    EXPECT_EQ(calls, 5);
}

TEST_F(Listen, AbsurdNumbersAreHarmless) {
    for (const std::string position : {"1e30 0 0", "1e9 1e9 0", "0 0 0", "30000 0 0", "1e-30 0 0"}) {
        Scene scene;
        load(scene, "DEF T Transform { translation " + position +
                        " scale 1 1e-20 1 children [ DEF S Sound { minFront 0 minBack 1e30 maxFront 1e38 maxBack 1e38 "
                        "source DEF C "
                        "AudioClip { url \"tone.wav\" loop TRUE pitch 1e30 startTime -1e300 } } SpatialSound { "
                        "referenceDistance 0 children OscillatorSource { frequency 1e30 } } ] }\n"
                        "Shape { geometry Box { size 1e15 1 1e-15 } }\nViewpoint { position 0 0 0 }\n");
        ListenOptions o = options();
        o.metrics = true;
        o.trace.rays = 100;
        const auto before = listen(scene, o);
        ASSERT_TRUE(before) << before.error().text;
        const float nan = std::numeric_limits<float>::quiet_NaN();
        const NodeId sound = scene.findName("S");
        (void)scene.set(sound, x3d::Sound::intensity, nan);
        (void)scene.set(sound, x3d::Sound::location, Vec3f(nan, 0, 0));
        (void)scene.set(sound, x3d::Sound::maxFront, std::numeric_limits<float>::infinity());
        (void)scene.set(scene.findName("C"), x3d::AudioClip::pitch, nan);
        (void)scene.set(scene.findName("T"), x3d::Transform::translation, Vec3f(nan, nan, nan));
        const auto after = listen(scene, o);
        ASSERT_TRUE(after) << after.error().text;
        for (const auto* report : {&*before, &*after})
            for (const float sample : report->sound.samples) ASSERT_TRUE(std::isfinite(sample)) << position;
    }
}

}  // namespace
}  // namespace rtsg
