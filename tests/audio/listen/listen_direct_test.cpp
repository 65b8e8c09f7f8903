// Direct sound of whole scenes: when it arrives, how loud, from where, through which channels.
#include <cmath>
#include <complex>

#include <fmt/format.h>

#include "edges/diffraction_wedge.h"

#include "audio/signal/rigid_sphere.h"
#include "listen_scene.h"

namespace rtsg {
namespace {

using namespace test;

TEST_F(Listen, AmbisonicSoundKnowsItsDirections) {
    Scene scene;
    // Nothing is mirrored: what is late comes from all sides alike.
    load(scene, room("absorption .3 diffuse .7",
                     "Sound { location 2 4 1.5 minBack 30 minFront 30 maxBack 60 maxFront 60 source AudioClip { url "
                     "\"impulse.wav\" } }\nViewpoint { position 4 2 1.5 }\n"));
    ListenOptions o = options();
    o.seconds = 0.4;
    o.render.ambisonicOrder = 2;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report) << report.error().text;
    ASSERT_EQ(report->sound.channels, 9);
    ASSERT_EQ(report->sound.frames(), static_cast<std::size_t>(0.4 * kRate));
    // Two metres to the left and two up: W 1, Y (left) and Z (up) 1 / sqrt 2, X (ahead) 0.
    const auto delay = static_cast<std::size_t>(std::lround(std::sqrt(8.0) / 343 * kRate));
    std::array<double, 9> direct{}, late{}, fourth{};
    for (std::size_t i = 0; i < report->sound.frames(); ++i)
        for (std::size_t c = 0; c < 9; ++c) {
            const double x = static_cast<double>(report->sound.samples[9 * i + c]) / static_cast<double>(report->gain);
            if (i + 30 > delay && i < delay + 30)
                direct[c] += x * static_cast<double>(report->sound.samples[9 * i]) / static_cast<double>(report->gain);
            if (i > delay + 2000) late[c] += x * x, fourth[c] += x * x * x * x;
        }
    EXPECT_NEAR(direct[1] / direct[0], std::sqrt(.5), .02);
    EXPECT_NEAR(direct[2] / direct[0], std::sqrt(.5), .02);
    EXPECT_NEAR(direct[3] / direct[0], 0, .02);
    EXPECT_NEAR(direct[5] / direct[0], std::sqrt(3) * .5, .02);  // sqrt(3) y z
    // Late sound comes from everywhere: a channel of degree l holds 1 / (2 l + 1) of what W does. It is noise that
    // fades: the variance of a sum of its squares is two thirds of the sum of its fourth powers. Five deviations are
    // exceeded less than once in a million times.
    for (const auto& [from, to] : {std::pair(1u, 4u), std::pair(4u, 9u)}) {
        double energy = 0, variance = 2.0 / 3 * fourth[0] / (late[0] * late[0]);
        for (std::size_t c = from; c < to; ++c) {
            energy += late[c] / late[0];
            variance += 2.0 / 3 * fourth[c] / (late[0] * late[0]);
        }
        EXPECT_NEAR(energy, 1, 5 * std::sqrt(variance));
        EXPECT_LT(5 * std::sqrt(variance), .2);
    }
}

TEST_F(Listen, DirectSoundAndEdgesSoundTogetherAsTheHalfPlaneHasThem) {
    // A tone beside a half plane, direct sound rendered for itself and what the edge bends by a response.
    const std::string wall =
        "Shape { appearance Appearance { acousticProperties AcousticProperties { absorption 0 specular 1 } } geometry "
        "IndexedFaceSet { solid FALSE coord Coordinate { point [ 0 0 -300 300 0 -300 300 0 300 0 0 300 ] } coordIndex "
        "[ 0 1 2 3 -1 ] } }\n";
    const auto pressure = [&](const std::string& walls, double degrees) {
        Scene scene;
        const double angle = degrees * M_PI / 180;
        load(scene, walls +
                        "Sound { location 1.5 2.598076 0 minBack 1 minFront 1 maxBack 400 maxFront 400 source "
                        "AudioClip { loop TRUE url \"tone.wav\" } }\n" +
                        fmt::format("Viewpoint {{ position {} {} 1 }}\n", 2 * std::cos(angle), 2 * std::sin(angle)));
        ListenOptions o = options();
        o.seconds = 1;
        o.render.ambisonicOrder = 1;
        o.render.trace.air.absorbs = false;
        o.render.trace.air.speedOfSound = 343;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report) << report.error().text;
        std::complex<double> sum;
        for (std::size_t i = kRate / 2; report && i < report->sound.frames() - kRate / 10; ++i)
            sum += std::polar(static_cast<double>(report->sound.samples[4 * i]), -2 * M_PI * 1000 * double(i) / kRate) /
                   static_cast<double>(report->gain);
        return std::abs(sum);
    };
    for (const double degrees : {90.0, 150.0, 200.0, 235.0, 245.0, 300.0}) {
        const WedgePath path{2 * M_PI, 3, 2, 1, M_PI / 3, degrees * M_PI / 180};
        const double distance = std::sqrt(14 - 12 * std::cos(path.receiverAngle - path.sourceAngle));
        EXPECT_NEAR(20 * std::log10(pressure(wall, degrees) / pressure("", degrees)),
                    20 * std::log10(std::abs(wedgeField(path, 2 * M_PI * 1000 / 343).total()) * distance), .1)
            << degrees;
    }
}

TEST_F(Listen, DirectSoundComesAfterItsDelayAtItsLevel) {
    for (const int samples : {100, 700, 4800}) {
        Scene scene;
        const double distance = samples * 343.0 / kRate;
        load(scene, "Sound { location 0 0 " + std::to_string(-distance) +
                        " minBack 0 minFront 0 maxBack 70 maxFront 70 source AudioClip { url \"impulse.wav\" } }\n"
                        "Viewpoint { position 0 0 0 }\n");
        const auto report = listen(scene, options());
        ASSERT_TRUE(report) << report.error().text;
        EXPECT_EQ(report->sound.frames(), 9600u);
        const std::size_t at = peak(report->sound, 0);
        EXPECT_EQ(at, static_cast<std::size_t>(samples));
        EXPECT_EQ(peak(report->sound, 1), at);
        // Inner ellipsoid without extent, outer at 70 m: linear in decibels between.
        EXPECT_NEAR(report->sound.samples[2 * at], 0.5 * std::pow(10.0, -distance / 70), 2e-3);
        EXPECT_TRUE(report->diagnostics.all().empty());
    }
}

TEST_F(Listen, PhysicalLevelsFallAsOneOverDistance) {
    std::vector<double> level;
    for (const double distance : {2.0, 4.0}) {
        Scene scene;
        load(scene, "Sound { location 0 0 " + std::to_string(-distance) +
                        " source AudioClip { url \"tone.wav\" } }\nViewpoint { position 0 0 0 }\n");
        ListenOptions o = options();
        o.render.levels = AcousticRenderer::Levels::physical;
        const auto report = listen(scene, o);
        ASSERT_TRUE(report);
        double energy = 0;
        for (std::size_t i = 2 * 4000; i < 2 * 9000; i += 2)
            energy += report->sound.samples[i] * report->sound.samples[i];
        level.push_back(std::sqrt(energy / 5000 * 2));
    }
    EXPECT_NEAR(level[0], 0.5 / 2, 1e-3);
    EXPECT_NEAR(level[1], 0.5 / 4, 1e-3);
}

TEST_F(Listen, SidesAndTheListenersTurn) {
    const auto energies = [&](const std::string& view, bool binaural) {
        Scene scene;
        load(scene, "Sound { location 3 0 0 source AudioClip { url \"tone.wav\" } }\n" + view);
        ListenOptions o = options();
        o.render.binaural = binaural;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        std::array<double, 2> energy{};
        for (std::size_t i = 0; i < report->sound.samples.size(); ++i)
            energy[i % 2] += report->sound.samples[i] * report->sound.samples[i];
        return energy;
    };
    for (const bool binaural : {false, true}) {
        // As on the near and far side of a sphere, at 1 kHz.
        const double apart =
            binaural ? std::norm(earOnSphere(.0875, 1000, 90, 1) / earOnSphere(.0875, 1000, 90, 0)) : 19;
        const auto right = energies("Viewpoint { position 0 0 0 }", binaural);
        EXPECT_NEAR(right[1] / right[0], apart, .02 * apart);
        const auto left = energies("Viewpoint { position 0 0 0 orientation 0 1 0 3.14159265 }", binaural);
        EXPECT_NEAR(left[0] / left[1], apart, .02 * apart);
        const auto ahead = energies("Viewpoint { position 0 0 0 orientation 0 1 0 -1.57079633 }", binaural);
        EXPECT_NEAR(ahead[0] / ahead[1], 1, binaural ? 0.05 : 1e-3);
        // A listener of its own goes before the viewpoint.
        const auto own = energies("Viewpoint { position 0 0 0 } ListenerPointSource { position 6 0 0 }", binaural);
        EXPECT_NEAR(own[0] / own[1], apart, .02 * apart);
    }
}

TEST_F(Listen, AMovingSourceIsShiftedByDoppler) {
    // Towards the listener at 20 m/s: f / (1 - v / c) exactly, which only the emission time gives.
    Scene scene;
    load(scene,
         "DEF Car Transform { translation 0 0 -60 children Sound { minBack 100 minFront 100 maxBack 200 maxFront 200 "
         "source AudioClip { url \"tone.wav\" loop TRUE } } }\n"
         "DEF Clock TimeSensor { cycleInterval 2 loop TRUE }\n"
         "DEF Way PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 -60 0 0 -20 ] }\n"
         "ROUTE Clock.fraction_changed TO Way.set_fraction\nROUTE Way.value_changed TO Car.translation\n"
         "Viewpoint { position 0 0 0 }\n");
    ListenOptions o = options();
    o.seconds = 1.2;
    const auto report = listen(scene, o);
    ASSERT_TRUE(report);
    // Count zero crossings between .5 and 1.1 s.
    double first = 0, last = 0;
    int crossings = 0;
    const auto& x = report->sound.samples;
    for (std::size_t i = kRate / 2; i < static_cast<std::size_t>(1.1 * kRate); ++i)
        if (x[2 * i] < 0 && x[2 * i + 2] >= 0) {
            const double at = static_cast<double>(i) + x[2 * i] / (x[2 * i] - x[2 * i + 2]);
            if (crossings++ == 0) first = at;
            last = at;
        }
    const double frequency = (crossings - 1) / (last - first) * kRate;
    EXPECT_NEAR(frequency, 1000 / (1 - 20 / 343.0), 0.5);
}

TEST_F(Listen, WhatWasSwitchedOffIsByThenWhereItsClockIs) {
    SoundBuffer ramp{kRate, 1, {}};
    for (int i = 0; i < kRate; ++i) ramp.samples.push_back(static_cast<float>(i) / kRate);
    ASSERT_TRUE(writeWav((folder_ / "ramp.wav").string(), ramp, WavFormat::float32));
    for (const char* off : {"Voice.enabled", "Clip.enabled"}) {
        Scene scene;
        load(scene, std::string("DEF Voice Sound { location 0 0 -3.43 minBack 9 minFront 9 source DEF Clip AudioClip { "
                                "url \"ramp.wav\" } }\nViewpoint { position 0 0 0 }\n"
                                "DEF Off TimeSensor { startTime .1 cycleInterval .3 }\nDEF Not BooleanFilter { }\n"
                                "ROUTE Off.isActive TO Not.set_boolean\nROUTE Not.inputNegate TO ") +
                        off);
        ListenOptions o = options();
        o.seconds = .7;
        const auto report = listen(scene, o);
        ASSERT_TRUE(report) << report.error().text;
        const auto at = [&](double t) { return report->sound.samples[2 * static_cast<std::size_t>(t * kRate)]; };
        EXPECT_NEAR(at(.09), .08, 1e-3) << off;
        EXPECT_EQ(at(.3), 0) << off;
        EXPECT_NEAR(at(.6), .59, 1e-3) << off;
    }
}

TEST_F(Listen, ClipsKeepTheirChannels) {
    SoundBuffer opposite{kRate, 2, {}}, same{kRate, 2, {}}, one{kRate, 1, {}};
    for (int i = 0; i < kRate / 2; ++i) {
        const auto x = static_cast<float>(.4 * std::sin(2 * M_PI * 700 * i / double{kRate}));
        opposite.samples.insert(opposite.samples.end(), {x, -x});
        same.samples.insert(same.samples.end(), {x, x});
        one.samples.push_back(x);
    }
    ASSERT_TRUE(writeWav((folder_ / "opposite.wav").string(), opposite, WavFormat::float32));
    ASSERT_TRUE(writeWav((folder_ / "same.wav").string(), same, WavFormat::float32));
    ASSERT_TRUE(writeWav((folder_ / "one.wav").string(), one, WavFormat::float32));
    const auto hear = [&](const std::string& file, bool spatialize, int mode) {
        Scene scene;
        load(scene, std::string("Sound { location 0 0 -3 spatialize ") + (spatialize ? "TRUE" : "FALSE") +
                        " minBack 9 minFront 9 source AudioClip { url \"" + file +
                        "\" } }\nViewpoint { position 0 0 0 }\n");
        ListenOptions o = options();
        o.render.binaural = mode == 1;
        o.render.ambisonicOrder = mode == 2 ? 1 : 0;
        const auto report = listen(scene, o);
        EXPECT_TRUE(report);
        return report->sound;
    };
    for (const bool spatialize : {true, false}) {
        const SoundBuffer both = hear("opposite.wav", spatialize, 0), mono = hear("one.wav", spatialize, 0),
                          pair = hear("same.wav", spatialize, 0);
        double maximum = 0;
        for (std::size_t i = 0; i < mono.frames(); ++i) {
            ASSERT_NEAR(both.samples[2 * i], -both.samples[2 * i + 1], 1e-6);
            ASSERT_NEAR(pair.samples[2 * i], mono.samples[2 * i], 1e-6);
            ASSERT_NEAR(both.samples[2 * i], mono.samples[2 * i], 1e-6);
            maximum = std::max(maximum, std::abs(static_cast<double>(mono.samples[2 * i])));
        }
        EXPECT_NEAR(maximum, .4, 2e-3);
    }
    EXPECT_GT(hear("opposite.wav", true, 1).peak(), .05f);
    EXPECT_GT(hear("opposite.wav", false, 1).peak(), .3f);
    EXPECT_GT(hear("opposite.wav", true, 2).peak(), .1f);
}

TEST_F(Listen, PlainStereoHasTheSameEnergyInEveryDirection) {
    for (int degrees = 0; degrees < 360; degrees += 30) {
        const double a = degrees * M_PI / 180;
        Scene scene;
        load(scene,
             fmt::format("Sound {{ location {} 0 {} minBack 9 minFront 9 source AudioClip {{ url \"tone.wav\" }} }}\n"
                         "Viewpoint {{ position 0 0 0 }}\n",
                         3.43 * std::sin(a), -3.43 * std::cos(a)));
        const auto report = listen(scene, options());
        ASSERT_TRUE(report);
        std::array<double, 2> energy{};
        for (std::size_t i = 2 * 1000; i < 2 * 9400; ++i)
            energy[i % 2] += std::pow(static_cast<double>(report->sound.samples[i]), 2) / 8400;
        EXPECT_NEAR(10 * std::log10((energy[0] + energy[1]) / .25), 0, .01) << degrees;
        EXPECT_NEAR(energy[1] / (energy[0] + energy[1]), (1 + .9 * std::sin(a)) / 2, 1e-3) << degrees;
    }
}

TEST_F(Listen, EllipsoidsAndDistanceLaws) {
    SoundNode sound;
    sound.minFront = 2, sound.minBack = 1, sound.maxFront = 10, sound.maxBack = 5;
    EXPECT_NEAR(sound.level({0, 0, 1.9}), 1, 1e-12);
    EXPECT_NEAR(sound.level({0, 0, -0.9}), 1, 1e-12);
    EXPECT_NEAR(sound.level({0, 0, 6}), 0.1 * std::pow(10, 0.5), 1e-12);  // half way: -10 dB
    EXPECT_NEAR(sound.level({0, 0, -3}), 0.1 * std::pow(10, 0.5), 1e-12);
    EXPECT_EQ(sound.level({0, 0, 10.1}), 0);
    EXPECT_EQ(sound.level({0, 0, -5.1}), 0);
    // At right angles the radius is the harmonic mean 2 f b / (f + b).
    EXPECT_NEAR(sound.level({4.0 / 3 - 1e-9, 0, 0}), 1, 1e-9);
    EXPECT_GT(sound.level({20.0 / 3 - 1e-6, 0, 0}), 0.09);
    EXPECT_EQ(sound.level({20.0 / 3 + 1e-6, 0, 0}), 0);
    sound.law = SoundNode::Law::inverse;
    EXPECT_NEAR(sound.level({0, 4, 0}), 0.25, 1e-12);
    sound.law = SoundNode::Law::linear;
    sound.maxDistance = 11;
    EXPECT_NEAR(sound.level({0, 6, 0}), 0.5, 1e-12);
    // Web Audio API, PannerNode: distances in the wrong order are turned round; where they are one, all is beyond.
    sound.referenceDistance = 10, sound.maxDistance = 1;
    EXPECT_NEAR(sound.level({0, 5, 0}), 1 - 4.0 / 9, 1e-12);
    sound.referenceDistance = sound.maxDistance = 3, sound.rolloff = .7;
    EXPECT_NEAR(sound.level({0, 1, 0}), .3, 1e-12);
    EXPECT_NEAR(sound.level({0, 5, 0}), .3, 1e-12);
    sound.referenceDistance = 1, sound.maxDistance = 11, sound.rolloff = 1;
    sound.law = SoundNode::Law::exponential;
    sound.rolloff = 2;
    EXPECT_NEAR(sound.level({0, 3, 0}), 1.0 / 9, 1e-12);
    sound.coneInner = 1, sound.coneOuter = 2, sound.coneOuterGain = .2;
    EXPECT_EQ(sound.coneGain({0, 0, 3}), 1);
    EXPECT_EQ(sound.coneGain({0, 0, -3}), .2);
    EXPECT_NEAR(sound.coneGain({std::sin(.75), 0, std::cos(.75)}), .6, 1e-9);
}

}  // namespace
}  // namespace rtsg
