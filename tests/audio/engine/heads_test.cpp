// By which head sounds are heard: SpatialSound's enableHRTF and the interauralDistance of who listens, against the
// series for a rigid sphere and what --binaural gives.
#include <array>
#include <cmath>
#include <complex>
#include <filesystem>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "audio/listen/listen_scene.h"
#include "audio/signal/rigid_sphere.h"

namespace rtsg {
namespace {

constexpr double kSpeed = 343, kHertz = 500;
const std::filesystem::path kMeasured = "/usr/share/libmysofa/default.sofa";

/// Amplitude and delay (s, modulo a period) of a tone that began at 0, by ear.
struct Ear {
    double amplitude, delay;
};

class Heads : public test::Listen {
  protected:
    ListenOptions plain() const {
        ListenOptions asked = options();
        asked.render.reflections = false;
        return asked;
    }
    SoundBuffer heard(const std::string& body, const ListenOptions& asked, const std::string& reported = "") {
        Scene scene;
        load(scene, body);
        const auto report = listen(scene, asked);
        EXPECT_TRUE(report);
        std::string said;
        for (const Diagnostic& d : report->diagnostics.all()) said += d.text;
        EXPECT_EQ(said, reported);
        return report->sound;
    }
    /// From .1 to .15 s.
    static std::array<Ear, 2> ears(const SoundBuffer& sound, double hertz = kHertz) {
        std::array<Ear, 2> result{};
        for (std::size_t e = 0; e < 2; ++e) {
            std::complex<double> sum = 0;
            for (std::size_t i = 4800; i < 7200; ++i)
                sum += static_cast<double>(sound.samples[2 * i + e]) *
                       std::polar(1.0, -2 * std::numbers::pi * hertz * static_cast<double>(i) / kRate);
            // A sine from time 0 on has the phase of -pi / 2.
            result[e] = {std::abs(sum) / 120, -(std::arg(sum) + std::numbers::pi / 2) / (2 * std::numbers::pi * hertz)};
        }
        return result;
    }
    static double moduloPeriod(double seconds) { return std::remainder(seconds, 1 / kHertz); }
};

std::string hornAt(const std::string& fields, double azimuth, double distance = 5) {
    const double a = azimuth * std::numbers::pi / 180;
    return fmt::format(
        "DEF Horn SpatialSound {{ rolloffFactor 0 intensity .1 location {:.9g} 0 {:.9g} {} children OscillatorSource "
        "{{ frequency "
        "{} }} "
        "}}\n",
        distance * std::sin(a), -distance * std::cos(a), fields, kHertz);
}

/// Where the sound has two channels it is what --binaural gives, and without the field it is panned.
TEST_F(Heads, EnableHrtfIsHeardByTheHeadOfBinauralSound) {
    ListenOptions binaural = plain();
    binaural.render.binaural = true;
    for (const double azimuth : {0.0, 70.0, 200.0}) {
        SCOPED_TRACE(azimuth);
        const std::string view = "Viewpoint { position 0 0 0 }";
        const SoundBuffer whole = heard(hornAt("", azimuth) + view, binaural),
                          own = heard(hornAt("enableHRTF TRUE", azimuth) + view, plain()),
                          panned = heard(hornAt("enableHRTF FALSE", azimuth) + view, plain());
        ASSERT_EQ(whole.samples.size(), own.samples.size());
        double maximum = 0;
        for (std::size_t i = 0; i < own.samples.size(); ++i)
            maximum = std::max(maximum, std::abs(static_cast<double>(whole.samples[i] - own.samples[i])));
        EXPECT_LT(maximum, 1e-6);
        // Panned, both at the same time.
        const double right = .9 * std::sin(azimuth * std::numbers::pi / 180);
        const auto both = ears(panned);
        EXPECT_NEAR(both[0].amplitude, std::sqrt(1 - right), 1e-4);
        EXPECT_NEAR(both[1].amplitude, std::sqrt(1 + right), 1e-4);
        EXPECT_NEAR(moduloPeriod(both[0].delay - both[1].delay), 0, 1e-7);
        if (azimuth == 70) {
            EXPECT_GT(moduloPeriod(ears(own)[0].delay - ears(own)[1].delay), 4e-4);
        }
    }
    // One's own head goes before a sphere.
    if (std::filesystem::exists(kMeasured)) {
        ListenOptions own = plain();
        own.render.hrtf = binaural.render.hrtf = *Hrtf::load(kMeasured, kRate);
        const std::string ear = "ListenerPointSource { interauralDistance .4 }";
        const SoundBuffer through = heard(hornAt("enableHRTF TRUE", 70) + ear, own);
        EXPECT_EQ(heard(hornAt("", 70) + ear, binaural).samples, through.samples);
        EXPECT_NE(heard(hornAt("", 70) + ear, own).samples, through.samples);
    }
    // It is for two channels: ambisonic sound has its directions anyway.
    ListenOptions ambisonic = plain();
    ambisonic.render.ambisonicOrder = 1;
    EXPECT_EQ(heard(hornAt("", 70), ambisonic).samples, heard(hornAt("enableHRTF TRUE", 70), ambisonic).samples);
}

/// The two are heard one after the other, without a gap, and beside each other as if alone.
TEST_F(Heads, EnableHrtfChangesWhileItIsHeardAndConcernsItsSoundAlone) {
    ListenOptions binaural = plain();
    binaural.render.binaural = true;
    const std::string view = "Viewpoint { position 0 0 0 }";
    const SoundBuffer through = heard(hornAt("", 70) + view, binaural), panned = heard(hornAt("", 70) + view, plain());
    for (const bool first : {false, true}) {
        Scene scene;
        load(scene, hornAt(first ? "enableHRTF TRUE" : "", 70) + view);
        ListenOptions asked = plain();
        asked.runTo = [&](double t) {
            if (t > .0999) {
                EXPECT_TRUE(scene.set(scene.findName("Horn"), x3d::SpatialSound::enableHRTF, !first));
            }
            scene.newFrame(t);
        };
        const auto report = listen(scene, asked);
        ASSERT_TRUE(report);
        const SoundBuffer &before = first ? through : panned, &after = first ? panned : through;
        ASSERT_EQ(report->sound.samples.size(), before.samples.size());
        double maxBefore = 0, maxAfter = 0, steepest = 0;
        const auto& samples = report->sound.samples;
        for (std::size_t i = 0; i < samples.size(); ++i) {
            const auto apart = [&](const SoundBuffer& from) {
                return std::abs(static_cast<double>(samples[i] - from.samples[i]));
            };
            if (i < 2 * 4200) maxBefore = std::max(maxBefore, apart(before));
            // A head rings for a block or two.
            if (i > 2 * 6500) maxAfter = std::max(maxAfter, apart(after));
            if (i > 2 * 1500) steepest = std::max(steepest, std::abs(static_cast<double>(samples[i] - samples[i - 2])));
        }
        EXPECT_LT(maxBefore, 1e-5) << first;
        EXPECT_LT(maxAfter, 1e-5) << first;
        // A sine of this frequency has 2 pi f / rate, times what the louder ear gets.
        EXPECT_LT(steepest, .1 * 2 * 2 * std::numbers::pi * kHertz / kRate) << first;
    }
    std::string other = hornAt("enableHRTF TRUE", 70);
    other.replace(other.find("Horn"), 4, "Bell");
    const SoundBuffer both = heard(hornAt("", 70) + other + view, plain());
    for (std::size_t i = 0; i < both.samples.size(); ++i)
        ASSERT_NEAR(both.samples[i], panned.samples[i] + through.samples[i], 1e-5) << i;
}

/// A sound that gets its second channel when it leaves a head takes nothing from who stays: both together are what each
/// is alone.
TEST_F(Heads, AChannelThatComesWhenAHeadIsLeftConcernsItsSoundAlone) {
    SoundBuffer both{kRate, 2, {}};
    for (int i = 0; i < 2 * kRate; ++i) both.samples.push_back(i % 4 < 2 ? .2f : -.1f);
    ASSERT_TRUE(writeWav((folder_ / "both.wav").string(), both, WavFormat::float32));
    const std::string view = "Viewpoint { position 0 0 0 }\n",
                      clips = "DEF Mono AudioClip { url \"tone.wav\" }\nDEF Stereo AudioClip { url \"both.wav\" }\n";
    const auto sounding = [&](const std::string& body) {
        Scene scene;
        load(scene, body);
        ListenOptions asked = plain();
        asked.runTo = [&](double t) {
            if (const NodeId horn = scene.findName("Horn"); t > .0999 && horn != NodeId{}) {
                EXPECT_TRUE(scene.set(horn, x3d::SpatialSound::enableHRTF, false));
                EXPECT_TRUE(scene.set(horn, x3d::SpatialSound::children, Array<NodeId>{scene.findName("Stereo")}));
            }
            scene.newFrame(t);
        };
        const auto report = listen(scene, asked);
        EXPECT_TRUE(report);
        return report->sound;
    };
    std::string bell = hornAt("enableHRTF TRUE", 70);
    bell.replace(bell.find("Horn"), 4, "Bell");
    const std::string horn = "Group { children [ Switch { children [ " + clips +
                             " ] } DEF Horn SpatialSound { rolloffFactor 0 intensity .1 location -4 0 -3 enableHRTF "
                             "TRUE children USE Mono } ] }\n";
    const SoundBuffer together = sounding(bell + horn + view), one = sounding(bell + view),
                      other = sounding(horn + view);
    for (std::size_t i = 0; i < together.samples.size(); ++i)
        ASSERT_NEAR(together.samples[i], one.samples[i] + other.samples[i], 1e-5) << i;
}

/// Sound on its way when its source is removed from the scene arrives unchanged, by whichever head.
TEST_F(Heads, WhatIsGoneIsHeardOnByTheSameHead) {
    // 51.45 m away, .15 s; gone at .1 s.
    const std::string far = hornAt("", 70, 51.45), own = hornAt("enableHRTF TRUE", 70, 51.45),
                      view = "Viewpoint { position 0 0 0 }", wide = "ListenerPointSource { interauralDistance .3 }";
    ListenOptions through = plain();
    through.seconds = .3;
    const ListenOptions panned = through;
    if (std::filesystem::exists(kMeasured)) through.render.hrtf = *Hrtf::load(kMeasured, kRate);
    const std::vector<std::pair<std::string, ListenOptions>> directions{
        {far + view, panned}, {own + view, panned}, {own + wide, panned}, {own + view, through}};
    for (const auto& [body, options] : directions) {
        const auto until = [&](double gone) {
            Scene scene;
            load(scene, "DEF G Group { children [ " + body + " ] }");
            ListenOptions asked = options;
            asked.runTo = [&](double t) {
                if (t > gone) {
                    EXPECT_TRUE(scene.set(scene.findName("G"), x3d::Group::children, Array<NodeId>{}));
                }
                scene.newFrame(t);
            };
            const auto report = listen(scene, asked);
            EXPECT_TRUE(report);
            return report->sound;
        };
        const SoundBuffer all = until(1), cut = until(.0999);
        const auto loudest = [&](const SoundBuffer& sound, std::size_t from, std::size_t to, bool apart) {
            double maximum = 0;
            for (std::size_t i = 2 * from; i < 2 * to; ++i)
                maximum = std::max(maximum, std::abs(static_cast<double>(sound.samples[i]) -
                                                     (apart ? static_cast<double>(all.samples[i]) : 0)));
            return maximum;
        };
        EXPECT_GT(loudest(cut, 7500, 11'500, false), .04);
        EXPECT_LT(loudest(cut, 0, 11'500, true), 1e-5);
        EXPECT_LT(loudest(cut, 13'500, 14'400, false), 1e-4) << "what was not yet sent";
    }
}

/// Below another node it is the panner of the Web Audio API by that head: each ear's response, as loud together as by
/// "equalpower".
TEST_F(Heads, APannerOfAGraphHearsByTheHeadThatIsGiven) {
    if (!std::filesystem::exists(kMeasured)) GTEST_SKIP() << kMeasured << " is not there";
    ListenOptions asked = plain();
    asked.render.hrtf = *Hrtf::load(kMeasured, kRate);
    const SoundBuffer sound = heard(
        "AudioDestination { children SpatialSound { enableHRTF TRUE rolloffFactor 0 location 4 0 -3 children "
        "BufferAudioSource { sampleRate 48000 buffer [ .5 ] } } }\nViewpoint { position 0 0 0 }",
        asked);
    const Hrtf::Ears ears = asked.render.hrtf->at({.8, 0, -.6});
    for (std::size_t e = 0; e < 2; ++e)
        for (std::size_t i = 0; i < ears[e].size(); ++i)
            // It is read between samples twice, which a single impulse shows most.
            ASSERT_NEAR(sound.samples[2 * i + e], .5f * std::sqrt(.5f) * ears[e][i], 6e-5f) << e << ' ' << i;
}

/// Its level and delay are those of the pressure on it.
TEST_F(Heads, InterauralDistanceIsTheSizeOfASphereThatHears) {
    for (const bool binaural : {false, true})
        for (const double ears : {.12, .3})
            for (const double azimuth : {0.0, 25.0, 90.0, 150.0, -60.0}) {
                SCOPED_TRACE(fmt::format("{} {} {}", binaural, ears, azimuth));
                ListenOptions asked = plain();
                asked.render.binaural = binaural;
                const SoundBuffer sound =
                    heard(hornAt(binaural ? "" : "enableHRTF TRUE", azimuth) +
                              fmt::format("ListenerPointSource {{ interauralDistance {} }}", ears),
                          asked);
                const auto got = Heads::ears(sound);
                for (std::size_t e = 0; e < 2; ++e) {
                    const auto expected = test::earOnSphere(ears / 2, kHertz, azimuth, static_cast<int>(e));
                    const double later = -std::arg(expected) / (2 * std::numbers::pi * kHertz);
                    EXPECT_NEAR(moduloPeriod(got[e].delay - 5 / kSpeed - later), 0, 5e-7) << e;
                    EXPECT_NEAR(got[e].amplitude, std::abs(expected), 1e-3) << e;
                }
            }
    // Two loudspeakers have no ears.
    const SoundBuffer with = heard(hornAt("", 50) + "ListenerPointSource { interauralDistance .3 }", plain()),
                      without = heard(hornAt("", 50) + "ListenerPointSource { }", plain());
    EXPECT_EQ(with.samples, without.samples);
    // Nobody's ears are further apart than half a metre.
    ListenOptions asked = plain();
    asked.render.binaural = true;
    asked.seconds = .02;
    heard(hornAt("", 50) + "DEF Ear ListenerPointSource { interauralDistance 100 }", asked,
          "Ear: its interauralDistance is too large: 0.5 m count");
}

/// Reflections by a wall reach such ears too, for sources at rest and in motion.
TEST_F(Heads, ReflectionsComeToTheEarsOfASphere) {
    // A wall at z = 4, behind the listener: the image of a source at x 0 0 is at x 0 8.
    const std::string body =
        "Transform { translation 0 0 4.05 children Shape { geometry Box { size 400 400 .1 } appearance Appearance { "
        "acousticProperties AcousticProperties { specular 1 } } } }\n"
        "DEF Car Transform { translation 6 0 0 children SpatialSound { dopplerEnabled TRUE rolloffFactor 0 intensity "
        ".1 enableHRTF "
        "TRUE children OscillatorSource { frequency 500 } } }\nListenerPointSource { interauralDistance .4 }";
    for (const double speed : {0.0, 3.0}) {
        SCOPED_TRACE(speed);
        const auto created = [&](bool walls) {
            Scene scene;
            load(scene, body);
            ListenOptions asked = plain();
            asked.render.reflections = walls;
            asked.seconds = 1;
            asked.runTo = [&](double t) {
                EXPECT_TRUE(scene.set(scene.findName("Car"), x3d::Transform::translation,
                                      Vec3f(static_cast<float>(6 + speed * t), 0, 0)));
                scene.newFrame(t);
            };
            const auto report = listen(scene, asked);
            EXPECT_TRUE(report);
            return report->sound;
        };
        const SoundBuffer echo = created(true), direct = created(false);
        for (std::size_t e = 0; e < 2; ++e) {
            // The tone as it was when that went out which an ear hears at t; what is left of the phase is what the ear
            // hears too late.
            std::complex<double> sum = 0, level = 0;
            for (std::size_t i = 45'600; i < 47'520; ++i) {
                const double t = static_cast<double>(i) / kRate;
                double emitted = t, distance = 0, x = 0;
                for (int step = 0; step < 20; ++step) {
                    x = 6 + speed * emitted;
                    distance = std::hypot(x, 8);
                    emitted = t - distance / kSpeed;
                }
                // The pitch that is heard.
                const double pitch = 2 * std::numbers::pi * kHertz / (1 + speed * x / distance / kSpeed);
                const auto ear = test::onRigidSphere(pitch * .2 / kSpeed, std::acos((e == 0 ? -x : x) / distance));
                const auto rotation = std::polar(1.0, -2 * std::numbers::pi * kHertz * emitted - std::arg(ear));
                sum += static_cast<double>(echo.samples[2 * i + e] - direct.samples[2 * i + e]) * rotation;
                // Beside the source 1, at d of the image so many times less.
                const double near = 6 + speed * (t - (6 + speed * t) / kSpeed);
                level += near / distance * std::abs(ear);
            }
            EXPECT_NEAR(20 * std::abs(sum) / std::abs(level), 1, .015) << e;
            EXPECT_NEAR((std::arg(sum) + std::numbers::pi / 2) / (2 * std::numbers::pi * kHertz), 0, 2e-6) << e;
        }
    }
}

}  // namespace
}  // namespace rtsg
