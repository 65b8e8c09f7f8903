// SpatialSounds and Sounds between nodes of an audio graph: panned as the Web Audio API has it, at their places.
#include <cmath>
#include <complex>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include <rtsg/audio/hrtf.h>

#include "audio/signal/rigid_sphere.h"
#include "heard_graph.h"

namespace rtsg {
namespace {

using namespace test;

/// Left and right by the text of the Web Audio API, PannerNode, "equalpower": azimuth in degrees.
std::pair<double, double> equalPower(double azimuth, double left, double right, bool stereo) {
    if (azimuth < -90) azimuth = -180 - azimuth;
    if (azimuth > 90) azimuth = 180 - azimuth;
    const double x = !stereo ? (azimuth + 90) / 180 : azimuth <= 0 ? (azimuth + 90) / 90 : azimuth / 90;
    const double l = std::cos(x * M_PI / 2), r = std::sin(x * M_PI / 2);
    if (!stereo) return {left * l, left * r};
    return azimuth <= 0 ? std::pair(left + right * l, right * r) : std::pair(left * l, right + left * r);
}

/// Whatever stands between it and the destination, a SpatialSound is a panner at its place.
TEST(AudioPanner, ASpatialSoundBetweenNodesIsPannedAtItsPlace) {
    const std::string above[] = {"", "Gain { gain 1 children", "Delay { delayTime .01 children",
                                 "SpatialSound { spatialize FALSE referenceDistance 1000 children"};
    for (const double azimuth : {0., 20., 90., 135., 180., -1., -60., -90., -170.})
        for (const bool stereo : {false, true})
            for (const std::string& node : above) {
                SCOPED_TRACE(fmt::format("{} {} {}", azimuth, stereo, node));
                const double a = azimuth * M_PI / 180, distance = 4;
                // Height changes its distance only.
                const auto heard = hear(fmt::format("{} SpatialSound {{ gain .5 intensity .5 location {} 3 {} children "
                                                    "{} }} {}",
                                                    node, distance * std::sin(a), -distance * std::cos(a),
                                                    stereo ? kSteadyPair : kSteady, node.empty() ? "" : "}"),
                                        .1);
                const auto [left, right] = equalPower(azimuth, stereo ? .5 : .25, -.25, stereo);
                EXPECT_NEAR(heard[0][4000], .25 * left / 5, 1e-6);
                EXPECT_NEAR(heard[1][4000], .25 * right / 5, 1e-6);
            }
}

TEST(AudioPanner, APannersChannelsAndLevelsAreThoseOfItsFields) {
    const auto at = [](const std::string& graph) {
        const auto heard = hear("Gain { children " + graph + " }", .1);
        return std::pair(heard[0][4000], heard[1][4000]);
    };
    const auto both = [](double left, double right) {
        return testing::Pair(testing::DoubleNear(left, 1e-6), testing::DoubleNear(right, 1e-6));
    };
    const double ahead = .25 * std::sqrt(.5);
    // At the listener it is ahead; six channels are mixed down first; without a place there is a level only.
    EXPECT_THAT(at("SpatialSound { children " + kSteady + " }"), both(ahead, ahead));
    EXPECT_THAT(at("SpatialSound { location 0 0 -2 children BufferAudioSource { numberOfChannels 4 sampleRate 48000 "
                   "loop TRUE buffer [ .1 .2 .3 .4 ] } }"),
                both(.5 * (.2 + .3 * std::cos(M_PI / 2)), .5 * .3));
    EXPECT_THAT(at("SpatialSound { spatialize FALSE location 5 0 0 children " + kSteadyPair + " }"), both(.1, -.05));
    EXPECT_THAT(at("Gain { children [ SpatialSound { enabled FALSE children " + kSteady + " } " + kSteady + " ] }"),
                both(.25, .25));
    // A cone that points away, laws, and a Sound's ellipsoids: half way between them 10 dB less.
    EXPECT_THAT(at("SpatialSound { location 0 0 -1 direction 0 0 -1 coneInnerAngle 1 coneOuterAngle 2 coneOuterGain "
                   ".125 children " +
                   kSteady + " }"),
                both(.125 * ahead, .125 * ahead));
    EXPECT_THAT(at("SpatialSound { location 0 0 -6 distanceModel \"LINEAR\" maxDistance 11 children " + kSteady + " }"),
                both(.5 * ahead, .5 * ahead));
    EXPECT_THAT(at("Sound { location 0 0 -5.5 source " + kSteady + " }"),
                both(std::pow(10, -.5) * ahead, std::pow(10, -.5) * ahead));
    EXPECT_THAT(at("Sound { location 0 0 -11 source " + kSteady + " }"), both(0, 0));
    // The output has two channels.
    EXPECT_THAT(
        at("ChannelSelector { channelSelection 1 children SpatialSound { location 1 0 0 children " + kSteady + " } }"),
        both(.25, .25));
}

/// A panner by a head ("HRTF"): the ears of a sphere hear it, from ahead as loud as by "equalpower".
TEST(AudioPanner, ASpatialSoundBetweenNodesIsHeardByAHeadIfItSaysSo) {
    constexpr double kHertz = 500, kRate = 48000;
    for (const double ears : {0., .3})
        for (const double azimuth : {0., 40., 90., 160., -70.}) {
            SCOPED_TRACE(fmt::format("{} {}", ears, azimuth));
            const double a = azimuth * M_PI / 180, side = std::sin(a);
            const auto at = [&](const char* field) {
                return hear(fmt::format("Gain {{ children SpatialSound {{ {} rolloffFactor 0 location {} 0 {} children "
                                        "OscillatorSource {{ frequency {} gain .5 }} }} }}",
                                        field, 4 * side, -4 * std::cos(a), kHertz),
                            .3, nullptr, "", fmt::format("ListenerPointSource {{ interauralDistance {} }}", ears));
            };
            const auto by = at("enableHRTF TRUE"), equal = at("");
            for (std::size_t e = 0; e < 2; ++e) {
                std::complex<double> sum = 0, other = 0;
                for (std::size_t i = 4800; i < 9600; ++i) {
                    const auto rotation = std::polar(1.0, -2 * M_PI * kHertz * static_cast<double>(i) / kRate);
                    sum += by[e][i] * rotation;
                    other += equal[e][i] * rotation;
                }
                const double r = ears > 0 ? ears / 2 : .0875;
                const auto expected = earOnSphere(r, kHertz, azimuth, static_cast<int>(e));
                EXPECT_NEAR(std::abs(sum) / 2400, .5 * std::sqrt(.5) * std::abs(expected), 5e-4);
                // The delay is the time by which the head may be early; "equalpower" has no delay.
                const double later = static_cast<double>(Hrtf::sphere(48000, r, 343)->early()) / kRate -
                                     std::arg(expected) / (2 * M_PI * kHertz);
                EXPECT_NEAR(std::remainder(-(std::arg(sum) + M_PI / 2) / (2 * M_PI * kHertz) - later, 1 / kHertz), 0,
                            5e-7);
                if (std::abs(other) > 1) {
                    EXPECT_NEAR(std::arg(other), -M_PI / 2, 1e-4);
                }
            }
        }
}

/// In the frame of what it leads to; where that moves and where the listener turns it is heard without a step.
TEST(AudioPanner, APannerIsWhereItsDestinationIsAndFollows) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nDEF V Viewpoint { position 0 0 0 }\n"
                         "DEF T Transform { translation 0 0 -2 children AudioDestination { children Gain { gain 4 "
                         "children SpatialSound { location 0 0 -2 children " +
                             kSteady + " } } } }",
                         diagnostics));
    SharedWorld world(scene);
    ListenOptions options;
    options.metrics = false;
    SoundRenderer sound(world, options);
    std::array<double, 2> last{}, step{};
    const auto heard = [&](int frame) {
        scene.newFrame(frame / 60.0);
        EXPECT_TRUE(sound.renderFrame());
        for (std::size_t i = 0; i < sound.block().size(); ++i) {
            const auto now = static_cast<double>(sound.block()[i]);
            if (frame > 2) step[i % 2] = std::max(step[i % 2], std::abs(now - last[i % 2]));
            last[i % 2] = now;
        }
        return last;
    };
    for (int frame = 1; frame < 5; ++frame) heard(frame);
    EXPECT_NEAR(last[0], .25 * std::sqrt(.5), 1e-6);
    // To the right of who looks ahead, and twice as far away.
    ASSERT_TRUE(scene.set(scene.findName("T"), x3d::Transform::translation, Vec3f(8, 0, 2)));
    for (int frame = 5; frame < 9; ++frame) heard(frame);
    EXPECT_NEAR(last[0], 0, 1e-6);
    EXPECT_NEAR(last[1], .125, 1e-6);
    // Half a turn, and it is to the left.
    ASSERT_TRUE(scene.set(scene.findName("V"), x3d::Viewpoint::orientation, Rotation{0, 1, 0, 3.14159265f}));
    for (int frame = 9; frame < 13; ++frame) heard(frame);
    EXPECT_NEAR(last[0], .125, 1e-6);
    EXPECT_NEAR(last[1], 0, 1e-6);
    for (const double maximum : step) EXPECT_LT(maximum, .002);
}

}  // namespace
}  // namespace rtsg
