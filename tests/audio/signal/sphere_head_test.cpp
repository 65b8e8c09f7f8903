// The head that is a sphere: levels and times of its ears against the series for a rigid sphere, and Woodworth's
// formula.
#include <array>
#include <cmath>
#include <complex>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/audio/hrtf.h>
#include <rtsg/audio/impulse_response.h>

#include "audio/listen/listen_scene.h"
#include "audio/signal/rigid_sphere.h"

namespace rtsg {
namespace {

/// A tone of a signal, its phase that at sample `at`.
std::complex<double> toneOf(std::span<const float> samples, double hertz, double at, double rate) {
    std::complex<double> sum;
    for (std::size_t i = 0; i < samples.size(); ++i)
        sum +=
            static_cast<double>(samples[i]) * std::polar(1.0, -2 * M_PI * hertz * (static_cast<double>(i) - at) / rate);
    return sum;
}

glm::dvec3 towards(double azimuth, double height = 0) {
    const double a = azimuth * M_PI / 180, h = height * M_PI / 180;
    return {std::cos(h) * std::sin(a), std::sin(h), -std::cos(h) * std::cos(a)};
}

TEST(SphereHead, EarsHearWhatTheSeriesSays) {
    for (const int rate : {48000, 16000})
        for (const double radius : {.06, .0875, .25}) {
            const auto head = Hrtf::sphere(rate, radius, 343);
            EXPECT_EQ(head, Hrtf::sphere(rate, radius, 343));
            EXPECT_EQ(head->early(), Hrtf::sphere(rate, .0875, 343)->early()) << "whatever its size";
            for (const double azimuth : {0., 20., 60., 90., 117.3, 152., 180., -33., -71.25, -90.})
                for (const double hertz : {50., 300., 1000., 4000., 10'000., 18'000.}) {
                    if (hertz > .4 * rate) continue;
                    const Hrtf::Ears ears = head->at(towards(azimuth));
                    for (int e = 0; e < 2; ++e) {
                        SCOPED_TRACE(fmt::format("{} {} {} {} {}", rate, radius, azimuth, hertz, e));
                        const auto expected = test::earOnSphere(radius, hertz, azimuth, e);
                        const auto got =
                            toneOf(ears[static_cast<std::size_t>(e)], hertz, static_cast<double>(head->early()), rate);
                        EXPECT_LT(std::abs(got - expected), .004 * std::max(std::abs(expected), .25))
                            << std::abs(got) << ' ' << std::abs(expected);
                    }
                }
        }
    // The angle to the ear is all that counts.
    const auto head = Hrtf::sphere(48000, .0875, 343);
    const auto one = head->at(towards(30, 0)), other = head->at({.5, std::sqrt(.75), 0});
    for (std::size_t i = 0; i < one[0].size(); ++i) EXPECT_NEAR(one[0][i], other[0][i], 1e-6);
}

/// For low tones three radii times the sine, for clicks Woodworth's path past the sphere and round it.
TEST(SphereHead, TheEarsDifferInTimeAsClosedFormsSay) {
    constexpr double kRate = 48000, kRadius = .0875;
    const auto head = Hrtf::sphere(48000, kRadius, 343);
    for (const double azimuth : {10., 45., 90., 130.}) {
        SCOPED_TRACE(azimuth);
        const double side = std::sin(azimuth * M_PI / 180);
        const Hrtf::Ears ears = head->at(towards(azimuth));
        const auto ratio = toneOf(ears[0], 30, 0, kRate) / toneOf(ears[1], 30, 0, kRate);
        EXPECT_NEAR(-std::arg(ratio) / (2 * M_PI * 30), 3 * kRadius / 343 * side, 2e-6);
        EXPECT_NEAR(head->smoothDelay(towards(azimuth), 0) - head->smoothDelay(towards(azimuth), 1),
                    kRadius / 343 * (side + std::asin(side)) * kRate, 1e-9);
        // Nothing comes before that.
        for (std::size_t e = 0; e < 2; ++e) {
            const double at =
                static_cast<double>(head->early()) + kRadius / 343 * kRate * (e == 1 ? -side : std::asin(side));
            double before = 0, all = 0;
            for (std::size_t i = 0; i < ears[e].size(); ++i) {
                const double energy = static_cast<double>(ears[e][i]) * static_cast<double>(ears[e][i]);
                all += energy;
                if (static_cast<double>(i) < at - 8) before += energy;
            }
            EXPECT_LT(before, .01 * all) << e;
        }
    }
}

/// The response is advanced by the delay of the line: together they are the ear's response.
TEST(SphereHead, AResponseAndItsSmoothDelayAreWhatAnEarHears) {
    const auto head = Hrtf::sphere(48000, .0875, 343);
    for (const double azimuth : {0., 33., -100.}) {
        const glm::dvec3 from = towards(azimuth);
        Hrtf::Ears rest;
        const std::array<double, 2> delays{head->smoothDelay(from, 0), head->smoothDelay(from, 1)};
        head->at(from, rest, delays);
        const Hrtf::Ears whole = head->at(from);
        for (std::size_t e = 0; e < 2; ++e) {
            EXPECT_GT(delays[e], 16) << "a line needs as much to read between samples";
            for (const double hertz : {200., 2000., 12'000.})
                EXPECT_LT(std::abs(toneOf(rest[e], hertz, -delays[e], 48000) - toneOf(whole[e], hertz, 0, 48000)), .002)
                    << azimuth << ' ' << e << ' ' << hertz;
        }
    }
}

using SphereInScene = test::Listen;

/// The played sound equals the written response, for direct sound and for a reflection.
TEST_F(SphereInScene, WhatIsPlayedIsTheResponse) {
    for (const double ears : {0., .3}) {
        Scene scene;
        load(scene,
             "Transform { translation 0 0 4.05 children Shape { geometry Box { size 400 400 .1 } appearance Appearance "
             "{ "
             "acousticProperties AcousticProperties { specular 1 } } } }\n"
             "SpatialSound { rolloffFactor 1 referenceDistance 1 distanceModel \"INVERSE\" location -3 .5 1 children "
             "AudioClip { url \"impulse.wav\" } }\n" +
                 fmt::format("ListenerPointSource {{ position 0 0 0 interauralDistance {} }}", ears));
        ListenOptions asked = options();
        asked.render.binaural = true;
        asked.responses = ImpulseResponseOptions::Channels::binaural;
        asked.metrics = true;
        asked.render.air.absorbs = false;
        const auto report = listen(scene, asked);
        ASSERT_TRUE(report) << report.error().text;
        const SoundBuffer response = report->impulseResponses();
        ASSERT_EQ(response.channels, 2);
        // Lines that read between samples dull what is above .8 of half the rate.
        double apart = 0, all = 0;
        for (std::size_t e = 0; e < 2; ++e) {
            std::vector<float> written(3000), played(3000);
            for (std::size_t i = 0; i < 3000 && 2 * i + e < response.samples.size(); ++i) {
                written[i] = .5f * response.samples[2 * i + e];
                played[i] = report->sound.samples[2 * i + e];
            }
            for (double hertz = 100; hertz < 17'000; hertz *= 1.04) {
                const auto a = toneOf(written, hertz, 0, kRate), b = toneOf(played, hertz, 0, kRate);
                apart += std::norm(a - b);
                all += std::norm(a);
            }
        }
        EXPECT_GT(all, .1) << ears;
        EXPECT_LT(10 * std::log10(apart / all), -65) << ears;
    }
}

}  // namespace
}  // namespace rtsg
