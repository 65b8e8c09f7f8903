// Moving sources against the exact Doppler shift, and what is beside the line; responses that change without a tick.
#include <array>
#include <cmath>
#include <complex>
#include <filesystem>
#include <numbers>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "audio/signal/rigid_sphere.h"
#include "engine/acoustic_engine.h"
#include "engine/trajectory.h"
#include "played_frames.h"

namespace rtsg {
namespace {

constexpr double kMovingRate = 48000, kMovingTone = 1000;

/// Renders while `place` says where the emitter is.
template <class Position>
SoundBuffer render(const std::string& text, AcousticOptions options, double fps, double seconds,
                   const Position& positionAt) {
    options.trace.air.absorbs = false;
    return test::playedFrames(text, "Car", options, fps, seconds, [&](Scene& scene, NodeId car, double t) {
        EXPECT_TRUE(scene.set(car, x3d::Transform::translation, Vec3f(positionAt(t))));
    });
}

struct Line {
    double amplitude, besideDb;
};

/// Least squares of one line of known frequency from `from` to `to` seconds, and what is left.
Line fit(const SoundBuffer& sound, double hz, double from, double to) {
    double cc = 0, ss = 0, cs = 0, xc = 0, xs = 0, xx = 0;
    const auto channels = static_cast<std::size_t>(sound.channels);
    for (auto i = static_cast<std::size_t>(from * kMovingRate); i < static_cast<std::size_t>(to * kMovingRate); ++i) {
        const double a = 2 * std::numbers::pi * hz * static_cast<double>(i) / kMovingRate, c = std::cos(a),
                     s = std::sin(a);
        const auto x = static_cast<double>(sound.samples[i * channels]);
        cc += c * c, ss += s * s, cs += c * s, xc += x * c, xs += x * s, xx += x * x;
    }
    const double determinant = cc * ss - cs * cs;
    const double p = (xc * ss - xs * cs) / determinant, q = (xs * cc - xc * cs) / determinant;
    const double left = xx - p * xc - q * xs;
    return {std::hypot(p, q), 10 * std::log10(std::max(left, 1e-300) / xx)};
}

const std::string kCar =
    "DEF Car Transform { children Sound { minBack 300 minFront 300 maxBack 400 maxFront 400 source OscillatorSource { "
    "frequency 1000 } } }\nViewpoint { position 0 0 0 }\n";
const std::string kPlainCar =
    "DEF Car Transform { children SpatialSound { rolloffFactor 0 dopplerEnabled FALSE children OscillatorSource { "
    "frequency 1000 } } }\nViewpoint { position 0 0 0 }\n";

TEST(MovingSource, NothingIsBesideTheLineWhateverBlocksAndFrames) {
    for (const double speed : {1.0, 5.0, 34.0, -20.0})
        for (const std::size_t block : {64u, 256u, 1000u, 4096u})
            for (const double fps : {24.7, 60.0, 700.0}) {
                AcousticOptions options;
                options.blockSize = block;
                options.reflections = false;
                // Places are single precision: nearer than 64 m they are good for -94 dB at 1 kHz.
                const double start = speed > 0 ? -60 : -20;
                const SoundBuffer sound =
                    render(kCar, options, fps, 1.3, [&](double t) { return glm::dvec3(0, 0, start + speed * t); });
                const Line line = fit(sound, kMovingTone / (1 - speed / 343), .4, 1.2);
                EXPECT_LE(line.besideDb, -90)
                    << speed << " m/s, blocks of " << block << ", " << fps << " frames a second";
                EXPECT_NEAR(line.amplitude, 1, 1e-3);
            }
}

TEST(MovingSource, WithoutDopplerTheToneIsKept) {
    for (const double speed : {5.0, 34.0}) {
        AcousticOptions options;
        options.reflections = false;
        const SoundBuffer sound =
            render(kPlainCar, options, 60, 1.3, [&](double t) { return glm::dvec3(0, 0, -60 + speed * t); });
        const Line line = fit(sound, kMovingTone, .4, 1.2);
        EXPECT_LE(line.besideDb, -90) << speed;
        EXPECT_NEAR(line.amplitude, 1, 1e-3);
    }
}

TEST(MovingSource, WithoutDopplerTheDelayIsTakenInSilence) {
    // A click each half second, from a source that jumps by a fifth of a second of sound in between.
    AcousticOptions options;
    options.reflections = false;
    const std::string click =
        "DEF Car Transform { children SpatialSound { rolloffFactor 0 dopplerEnabled FALSE children BufferAudioSource { "
        "loop TRUE buffer [ 1 " +
        [] {
            std::string zeros;
            for (int i = 1; i < 24000; ++i) zeros += "0 ";
            return zeros;
        }() +
        "] sampleRate 48000 } } }\nViewpoint { position 0 0 0 }\n";
    const SoundBuffer sound =
        render(click, options, 60, .9, [](double t) { return glm::dvec3(0, 0, t < .3 ? -6.86 : -68.6); });
    const auto peakAfter = [&](double from, double to) {
        std::size_t best = static_cast<std::size_t>(from * kMovingRate);
        for (std::size_t i = best; i < static_cast<std::size_t>(to * kMovingRate); ++i)
            if (std::abs(sound.samples[2 * i]) > std::abs(sound.samples[2 * best])) best = i;
        return static_cast<double>(best) / kMovingRate;
    };
    EXPECT_NEAR(peakAfter(0, .3), .02, 1e-4);
    EXPECT_NEAR(peakAfter(.5, .9), .5 + .2, 1e-4);
}

TEST(MovingSource, AListenerThatWantsDopplerIsShiftedWhateverSourcesSay) {
    // f (1 + v / c) of a listener that moves towards what rests, which is another number than that of a source.
    AcousticOptions options;
    options.reflections = false;
    for (const bool wanted : {false, true})
        for (const double speed : {5.0, 34.0, -20.0}) {
            const std::string ears = std::string("DEF Car Transform { children ListenerPointSource { dopplerEnabled ") +
                                     (wanted ? "TRUE" : "FALSE") +
                                     " } }\nSpatialSound { location 0 0 -60 rolloffFactor 0 children OscillatorSource "
                                     "{ frequency 1000 } }\n";
            const SoundBuffer sound = render(ears, options, 60, 1.3, [&](double t) {
                return glm::dvec3(0, 0, (speed > 0 ? 0.0 : -40.0) - speed * t);
            });
            const Line line = fit(sound, wanted ? kMovingTone * (1 + speed / 343) : kMovingTone, .4, 1.2);
            EXPECT_LE(line.besideDb, -90) << speed << (wanted ? " with" : " without");
            EXPECT_NEAR(line.amplitude, 1, 1e-3);
        }
}

/// Share of the energy that lies farther than `hz` from the tone, by a window without sidelobes.
double farFromTheTone(const SoundBuffer& sound, double from, double hz) {
    constexpr std::size_t kSize = 32768;
    std::vector<std::complex<double>> x(kSize);
    const auto bessel = [](double v) {
        double sum = 1, term = 1;
        for (int k = 1; k < 80; ++k) sum += term *= (v / (2 * k)) * (v / (2 * k));
        return sum;
    };
    for (std::size_t i = 0; i < kSize; ++i) {
        const double u = 2.0 * static_cast<double>(i) / (kSize - 1) - 1;
        x[i] = static_cast<double>(sound.samples[2 * (static_cast<std::size_t>(from * kMovingRate) + i)]) *
               bessel(20 * std::sqrt(1 - u * u)) / bessel(20);
    }
    for (std::size_t i = 1, j = 0; i < kSize; ++i) {
        std::size_t bit = kSize >> 1;
        for (; j & bit; bit >>= 1) j ^= bit;
        j ^= bit;
        if (i < j) std::swap(x[i], x[j]);
    }
    for (std::size_t length = 2; length <= kSize; length *= 2)
        for (std::size_t i = 0; i < kSize; i += length)
            for (std::size_t k = 0; k < length / 2; ++k) {
                const auto w =
                    std::polar(1.0, -2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(length));
                const auto a = x[i + k], b = x[i + k + length / 2] * w;
                x[i + k] = a + b;
                x[i + k + length / 2] = a - b;
            }
    double all = 0, far = 0;
    for (std::size_t i = 0; i < kSize / 2; ++i) {
        const double energy = std::norm(x[i]);
        all += energy;
        if (std::abs(static_cast<double>(i) * kMovingRate / kSize - kMovingTone) > hz) far += energy;
    }
    return 10 * std::log10(far / all);
}

TEST(MovingSource, DopplerThatIsSwitchedOnFadesOverToWhereTheSourceIs) {
    // By then the source is 20 m nearer than it was heard: sound that hurried there would sweep through all tones.
    AcousticOptions options;
    options.reflections = false;
    const std::string car =
        "DEF Car Transform { children DEF Horn SpatialSound { rolloffFactor 0 children OscillatorSource { "
        "frequency 1000 } } }\nViewpoint { position 0 0 0 }\nDEF Clock TimeSensor { cycleInterval .6 }\n"
        "DEF Over BooleanFilter { }\nROUTE Clock.isActive TO Over.set_boolean\n"
        "ROUTE Over.inputNegate TO Horn.dopplerEnabled\n";
    const SoundBuffer sound = render(car, options, 60, 1.3, [](double t) { return glm::dvec3(0, 0, -60 + 34 * t); });
    EXPECT_LE(fit(sound, kMovingTone, .2, .55).besideDb, -90);
    EXPECT_LE(fit(sound, kMovingTone / (1 - 34.0 / 343), .7, 1.2).besideDb, -90);
    EXPECT_LE(farFromTheTone(sound, .3, 2000), -50);
}

TEST(MovingSource, NewResponsesDoNotTick) {
    AcousticOptions options;
    options.trace.rays = 400;
    options.trace.maxSeconds = 1;
    const std::string hall =
        "Transform { translation 3 2.5 1.5 children Shape { geometry Box { size 6 5 3 solid FALSE } } }\n"
        "DEF Car Transform { children Sound { minBack 30 minFront 30 maxBack 60 maxFront 60 source OscillatorSource { "
        "frequency 1000 } } }\nViewpoint { position 4 3 1.5 }\n";
    const SoundBuffer sound =
        render(hall, options, 60, 1.8, [](double t) { return glm::dvec3(1 + .6 * t, 1 + .3 * t, 1.5); });
    // Once the room has done with the tone's beginning, which is all tones.
    EXPECT_LE(farFromTheTone(sound, 1.05, 300), -125);
}

/// A wall that mirrors, behind a source that goes straight from it to the listener, or comes from there.
const std::string kWall =
    "Transform { translation 0 0 -80 children Shape { appearance Appearance { acousticProperties "
    "AcousticProperties { specular 1 } } geometry IndexedFaceSet { solid FALSE coordIndex [ 0 1 2 3 ] coord Coordinate "
    "{ point [ -900 -900 "
    "0, 900 -900 0, 900 900 0, -900 900 0 ] } } } }\n";

/// The sound by way of the wall alone: all sound minus the direct sound.
SoundBuffer reflection(const std::string& text, AcousticOptions options, double fps, double seconds, double start,
                       double speed, const glm::dvec3& axis = {0, 0, 1}) {
    const auto positionAt = [&](double t) { return axis * (start + speed * t); };
    options.trace.rays = 200;
    options.trace.maxSeconds = .7;
    SoundBuffer all = render(text, options, fps, seconds, positionAt);
    options.reflections = false;
    const SoundBuffer straight = render(text, options, fps, seconds, positionAt);
    for (std::size_t i = 0; i < all.samples.size(); ++i) all.samples[i] -= straight.samples[i];
    return all;
}

/// Its pitch is f / (1 + v / c), its level that of sound that left with the source's distance and came as far as the
/// image is, times what the first channel has of a tone from ahead.
void expectReflection(const AcousticOptions& options, double fps, double speed, const std::string& what,
                      double ahead = 1) {
    const double start = speed > 0 ? -60 : -30;
    SoundBuffer sound = reflection(kCar + kWall, options, fps, 1.6, start, speed);
    const auto channels = static_cast<std::size_t>(sound.channels);
    for (std::size_t i = 0; i < sound.frames(); ++i) {
        const double t = static_cast<double>(i) / kMovingRate;
        // When it left the image, how far away that was, and how far the source was heard to be by then.
        const double left = (t - (160 + start) / 343) / (1 + speed / 343);
        const double image = 160 + start + speed * left;
        const double heard = -(start + speed * (left + start / 343) / (1 - speed / 343));
        sound.samples[channels * i] *= static_cast<float>(image / heard);
    }
    const Line line = fit(sound, kMovingTone / (1 + speed / 343), .9, 1.5);
    EXPECT_LE(line.besideDb, -90) << what << ", " << speed << " m/s, " << fps << " frames a second";
    EXPECT_NEAR(line.amplitude, ahead, 2e-3) << what << ' ' << speed;
}

TEST(MovingSource, AReflectionFollowsInEveryBlock) {
    for (const double speed : {1.0, 5.0, 34.0, -10.0})
        for (const auto& [block, fps] : {std::pair(256u, 60.0), std::pair(64u, 24.7), std::pair(1000u, 60.0)}) {
            AcousticOptions options;
            options.blockSize = block;
            expectReflection(options, fps, speed, "blocks of " + std::to_string(block));
        }
}

TEST(MovingSource, AReflectionFollowsInOtherSoundThanStereo) {
    AcousticOptions ambisonic;
    ambisonic.ambisonicOrder = 2;
    expectReflection(ambisonic, 60, 5, "ambisonic");
    AcousticOptions binaural;
    binaural.binaural = true;
    expectReflection(binaural, 60, 5, "binaural",
                     std::abs(test::earOnSphere(.0875, kMovingTone / (1 + 5.0 / 343), 0, 0)));
}

/// From the left it is at each ear as on a rigid sphere.
TEST(MovingSource, AReflectionThatFollowsIsAtEachEarInItsTime) {
    AcousticOptions options;
    options.binaural = true;
    std::string wall = kWall;
    wall.replace(wall.find("0 0 -80"), 7, "-80 0 0 rotation 0 1 0 1.5707963");
    const SoundBuffer sound = reflection(kCar + wall, options, 60, 1.6, -60, 5, {1, 0, 0});
    const double w = 2 * std::numbers::pi * kMovingTone / (1 + 5.0 / 343);
    std::complex<double> left = 0, right = 0;
    for (std::size_t i = 43'200; i < 72'000; ++i) {
        const auto rotation = std::polar(1.0, -w * static_cast<double>(i) / kMovingRate);
        left += static_cast<double>(sound.samples[2 * i]) * rotation;
        right += static_cast<double>(sound.samples[2 * i + 1]) * rotation;
    }
    const double hz = w / (2 * std::numbers::pi);
    const auto expected = test::earOnSphere(.0875, hz, -90, 0) / test::earOnSphere(.0875, hz, -90, 1);
    EXPECT_LT(std::abs(left / right / expected - 1.0), .01);
}

/// Sound of one frequency in what each ear hears, from `from` to `to` seconds.
std::array<std::complex<double>, 2> toneAtEars(const SoundBuffer& sound, double hz, double from, double to) {
    const double w = 2 * std::numbers::pi * hz / kMovingRate;
    std::array<std::complex<double>, 2> ears;
    for (auto i = static_cast<std::size_t>(from * kMovingRate); i < static_cast<std::size_t>(to * kMovingRate); ++i)
        for (std::size_t e = 0; e < 2; ++e)
            ears[e] += static_cast<double>(sound.samples[2 * i + e]) * std::polar(1.0, -w * static_cast<double>(i));
    return ears;
}

/// Through a head that was measured: shifted, and in each ear as the set has it for where the image is.
TEST(MovingSource, AReflectionFollowsThroughAHead) {
    const std::filesystem::path file = "/usr/share/libmysofa/default.sofa";
    if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
    AcousticOptions options;
    options.binaural = true;
    options.hrtf = *Hrtf::load(file, static_cast<int>(kMovingRate));
    std::string wall = kWall;
    wall.replace(wall.find("0 0 -80"), 7, "-80 0 0 rotation 0 1 0 1.5707963");
    const double hz = kMovingTone / (1 + 5.0 / 343);
    SoundBuffer sound = reflection(kCar + wall, options, 60, 1.6, -60, 5, {1, 0, 0});
    for (std::size_t i = 0; i < sound.frames(); ++i) {
        // When it left the image, and how far away image and source were heard to be by then.
        const double left = (static_cast<double>(i) / kMovingRate - 100.0 / 343) / (1 + 5.0 / 343);
        const double image = 100 + 5 * left, source = 60 - 5 * (left - 60.0 / 343) / (1 - 5.0 / 343);
        for (std::size_t e = 0; e < 2; ++e) sound.samples[2 * i + e] *= static_cast<float>(image / source);
    }
    EXPECT_LE(fit(sound, hz, .9, 1.5).besideDb, -90);
    const auto heard = toneAtEars(sound, hz, .9, 1.5);
    const Hrtf::Ears measured = options.hrtf->at({-1, 0, 0});
    std::array<std::complex<double>, 2> apart;
    for (std::size_t e = 0; e < 2; ++e) {
        std::complex<double> expected;
        for (std::size_t i = 0; i < measured[e].size(); ++i)
            expected += static_cast<double>(measured[e][i]) *
                        std::polar(1.0, -2 * std::numbers::pi * hz * static_cast<double>(i) / kMovingRate);
        EXPECT_NEAR(20 * std::log10(2 * std::abs(heard[e]) / (.6 * kMovingRate) / std::abs(expected)), 0, .05) << e;
        apart[e] = heard[e] / expected;
    }
    EXPECT_NEAR(std::arg(apart[0] / apart[1]), 0, .01);
}

/// On its way round the head it passes from direction to direction without a tick.
TEST(MovingSource, AReflectionThatGoesRoundAHeadDoesNotTick) {
    const std::filesystem::path file = "/usr/share/libmysofa/default.sofa";
    if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
    AcousticOptions options;
    options.binaural = true;
    options.hrtf = *Hrtf::load(file, static_cast<int>(kMovingRate));
    std::string wall = kWall;
    wall.replace(wall.find("0 0 -80"), 7, "0 0 -4");
    const SoundBuffer sound = reflection(kCar + wall, options, 60, 1.8, -6, 6, {1, 0, 0});
    EXPECT_LE(farFromTheTone(sound, 1.05, 300), -70);
}

/// With the share that the wall leaves in its band, to a quarter of a decibel.
TEST(MovingSource, AReflectionThatFollowsIsColouredByTheWall) {
    std::string wall = kWall;
    wall.insert(wall.find("specular"),
                "metadata MetadataFloat { name \"absorption\" value [ .1 .1 .15 .2 .3 .4 .5 .6 .7 .7 ] } ");
    const SoundBuffer sound = reflection(kCar + wall, {}, 60, 1.6, -30, 2);
    double energy = 0;
    constexpr std::size_t kFrom = 43'200, kTo = 72'000;
    for (std::size_t i = kFrom; i < kTo; ++i) {
        const double t = static_cast<double>(i) / kMovingRate, left = (t - 130.0 / 343) / (1 + 2.0 / 343);
        const double heard = -(-30 + 2 * (left - 30.0 / 343) / (1 - 2.0 / 343));
        energy += std::pow(static_cast<double>(sound.samples[2 * i]) * (130 + 2 * left) / heard, 2);
    }
    const double amplitude = std::sqrt(2 * energy / (kTo - kFrom));
    EXPECT_NEAR(20 * std::log10(amplitude / std::sqrt(.6)), 0, .25);
}

/// Sound that is not shifted keeps its delays, and its reflections do.
TEST(MovingSource, ReflectionsOfSoundThatIsNotShiftedKeepItsPitch) {
    const SoundBuffer sound = reflection(kPlainCar + kWall, {}, 60, 1.6, -30, 5);
    EXPECT_LE(farFromTheTone(sound, .8, 20), -40);
}

TEST(Trajectory, FollowsAParabolaExactlyAndGoesOnStraight) {
    Trajectory path(4);
    const auto at = [](double t) { return glm::dvec3(1 + .5 * t + .01 * t * t, 2 - .2 * t, 0); };
    for (int frame = 0; frame <= 10; ++frame) path.put(10.0 * frame, at(10.0 * frame), frame == 0);
    // Once three frames are known, between frames and at their ends.
    path.advance(93);
    path.advance(97);
    path.advance(100);
    for (const double t : {93.0, 97.0, 100.0}) {
        EXPECT_NEAR(path.at(t).position.x, at(t).x, 1e-9);
        EXPECT_NEAR(path.at(t).velocity.x, .5 + .02 * t, 1e-9);
    }
    path.advance(104);
    EXPECT_NEAR(path.at(104).position.x, at(100).x + 4 * 2.5, 1e-9);
    path.put(110, {500, 0, 0}, true);
    path.advance(114);
    EXPECT_NEAR(path.at(112).position.x, 500, 1e-12);
}

TEST(Trajectory, WhatStopsDoesNotSwingBack) {
    Trajectory path(10);
    for (int frame = 0; frame <= 40; ++frame) {
        path.put(100.0 * frame, glm::dvec3(std::min(frame, 20), 0, 0), frame == 0);
        for (int block = 1; block <= 10; ++block) path.advance(100.0 * frame + 10 * block);
        EXPECT_LT(path.at(100.0 * frame + 55).position.x, 20.6) << frame;
        if (frame > 36) {
            EXPECT_NEAR(path.at(100.0 * frame + 55).position.x, 20, 1e-9) << frame;
        }
    }
}

TEST(Trajectory, TellsTheSameOfAnyTimeHoweverLongAgo) {
    for (int blocks = 1; blocks <= 70; ++blocks) {
        Trajectory path(10);
        std::vector<double> times;
        std::vector<glm::dvec3> reported;
        const auto remember = [&](double time) { times.push_back(time), reported.push_back(path.at(time).position); };
        path.put(0, {0, 0, 0}, true);
        double end = 0;
        for (int block = 1; block <= blocks; ++block) {
            path.put(10.0 * block, {block % 3, block * block % 7, std::sin(block)}, false);
            const double before = end;
            end = 10.0 * block - 3 * (block % 2);
            path.advance(end);
            for (const double fraction : {.1, .5, 1.0}) remember(before + fraction * (end - before));
        }
        for (std::size_t i = 0; i < times.size(); ++i)
            EXPECT_EQ(path.at(times[i]).position, reported[i]) << blocks << " blocks, at " << times[i];
        EXPECT_EQ(path.at(-1).position, glm::dvec3(0));
    }
}

}  // namespace
}  // namespace rtsg
