// Waves by way of edges that are followed: their ways, and their spectra at any place, against the closed form.
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "edges/diffraction_wedge.h"

#include "edges/diffraction_route.h"
#include "images/followed_edges.h"
#include "signal/pole_bank.h"
#include "walled.h"

namespace rtsg {
namespace {

constexpr int kFollowedRate = 48000;

/// An edge along z with air for `opening`, and the wave that it bends between two places.
EdgeWave bentWave(double opening, const glm::dvec3& source, const glm::dvec3& listener, double mirrors = 1) {
    EdgeWave wave;
    wave.route.firstAxis = wave.route.lastAxis = {0, 0, 1};
    wave.bends = {{1, 0, 0}, {0, 1, 0}, opening, allBands(mirrors)};
    const WedgePath path = pathAbout(wave.route, wave.bends, source, listener);
    const double pathLength = std::hypot(path.sourceRadius + path.receiverRadius, path.along);
    wave.seconds = pathLength / 343;
    for (std::size_t tone = 0; tone < kEdgeTones; ++tone) {
        const double k = 2 * std::numbers::pi * edgeToneHz(static_cast<double>(tone)) / 343;
        const WedgeField field = wedgeField(path, k);
        wave.pressure[tone] = std::complex<float>((field.besideDirect + mirrors * field.besideMirrored) *
                                                  std::polar(1.0, k * pathLength));
    }
    return wave;
}

std::vector<FollowedImage> follow(const EdgeWave& wave, const glm::dvec3& source, const glm::dvec3& listener) {
    Echogram echogram;
    echogram.edges.waves.push_back(wave);
    TraceOptions options;
    options.air.absorbs = false;
    options.air.speedOfSound = 343;
    std::vector<FollowedImage> followed;
    addFollowedEdges(echogram, source, listener, options, kFollowedRate, 256, 16, followed);
    return followed;
}

std::complex<double> valueAt(const PoleBank::Weights& weights, double hz) {
    PoleFit::Weights wide;
    std::ranges::copy(weights, wide.begin());
    return PoleFit(kFollowedRate, {hz}).valueOf(wide, 0);
}

TEST(FollowedEdges, HaveTheSpectrumOfTheClosedFormWhereverTheSourceIs) {
    for (const double opening : {2 * M_PI, 1.5 * M_PI, 1.25 * M_PI})
        for (const double mirrors : {1.0, .6, 0.0}) {
            const glm::dvec3 start = test::about(3, 50, 0), listener = test::about(2, 210, .5);
            const auto followed = follow(bentWave(opening, start, listener, mirrors), start, listener);
            ASSERT_EQ(followed.size(), mirrors > 0 ? 3u : 1u);
            double worst = 0;
            for (const double degrees : {5., 20., 29.9, 29.99999, 30.00001, 30.1, 50., 120., 149.9, 150.1, 200.})
                for (const double radius : {.2, 3., 20.}) {
                    if (degrees > opening * 180 / M_PI) continue;
                    const glm::dvec3 source = test::about(radius, degrees, -1);
                    const WedgePath path =
                        pathAbout(followed[0].edge->route, followed[0].edge->bends, source, listener);
                    PoleBank::Weights weights{};
                    ASSERT_TRUE(followed[0].edge->weightsAt(source, listener, degrees > 30, weights));
                    const double pathLength = edgePath(followed[0].edge->route, source, listener).length;
                    EXPECT_NEAR(pathLength, std::hypot(radius + 2, 1.5), 1e-9);
                    for (const double hz : {31.5, 125., 1000., 4000., 8000., 16000.}) {
                        const double k = 2 * std::numbers::pi * hz / 343;
                        const WedgeField field = wedgeField(path, k);
                        const auto exact = (field.besideDirect + mirrors * field.besideMirrored) *
                                           std::polar(pathLength, k * pathLength);
                        const double off = std::abs(valueAt(weights, hz) * pathLength - exact);
                        worst = std::max(worst, off);
                        EXPECT_LE(off, hz < 5000 ? 2e-3 : 6e-3) << degrees << "° " << radius << " m " << hz << " Hz";
                    }
                }
            RecordProperty("worst", std::to_string(worst));
        }
}

TEST(FollowedEdges, KeepWhatTheClosedFormDoesNotKnow) {
    const glm::dvec3 source = test::about(3, 60, 0), listener = test::about(2, 300, 1);
    EdgeWave wave = bentWave(2 * M_PI, source, listener);
    for (auto& tone : wave.pressure) tone *= .7f;
    const auto followed = follow(wave, source, listener);
    PoleBank::Weights weights{};
    ASSERT_TRUE(followed[0].edge->weightsAt(source, listener, false, weights));
    for (std::size_t tone = 5; tone < 45; tone += 10)
        EXPECT_NEAR(std::abs(valueAt(weights, edgeToneHz(static_cast<double>(tone))) -
                             std::complex<double>(wave.pressure[tone])),
                    0, 1e-3);
    // Within the wedge nothing is known.
    wave.bends.opening = 1.5 * M_PI;
    EXPECT_FALSE(follow(wave, source, test::about(2, 200, 1))[0].edge->weightsAt(source, listener, false, weights));
}

TEST(FollowedEdges, AnImageStandsInForWhatTheTraceDoesNotKnowYet) {
    const glm::dvec3 source = test::about(3, 50, 0), listener = test::about(2, 100, 0);
    const auto followed = follow(bentWave(1.5 * M_PI, source, listener), source, listener);
    ASSERT_EQ(followed.size(), 3u);
    const auto gain = [&](std::size_t face, double degrees) {
        EXPECT_EQ(followed[1 + face].kind, FollowedImage::Kind::boundary);
        return followed[1 + face].edge->boundaryGain(face, test::about(3, degrees, 0), listener);
    };
    EXPECT_EQ(gain(0, 79), 0);
    EXPECT_EQ(gain(0, 81), -1);
    EXPECT_EQ(gain(1, 200), 0);
    EXPECT_EQ(gain(1, 261), 1);
    // By the face at 0 and by that at 270 degrees.
    EXPECT_NEAR(glm::distance(followed[1].at({1, 2, 3}), glm::dvec3(1, -2, 3)), 0, 1e-9);
    EXPECT_NEAR(glm::distance(followed[2].at({1, 2, 3}), glm::dvec3(-1, 2, 3)), 0, 1e-9);
}

TEST(EdgeRoute, IsTheShortestWayByBothEdgesAndGrowsAlongItsEnds) {
    EdgeRoute route{{0, 1, 0}, {1.5, 1.2, .1}, {0, 0, 1}, glm::normalize(glm::dvec3(.2, 0, 1))};
    const glm::dvec3 source(-2, .3, -1), listener(3, -.5, 2);
    const EdgePath path = edgePath(route, source, listener);
    double minimum = 1e9;
    const auto length = [&](double i, double j) {
        const glm::dvec3 p = route.first + route.firstAxis * i, q = route.last + route.lastAxis * j;
        return glm::distance(source, p) + glm::distance(p, q) + glm::distance(q, listener);
    };
    for (double i = -3; i < 3; i += .002)
        for (double j = -3; j < 3; j += .01) minimum = std::min(minimum, length(i, j));
    EXPECT_NEAR(path.length, minimum, 1e-4);
    EXPECT_LE(path.length, minimum);
    for (const EdgeRoute& one :
         {route, EdgeRoute{{0, 1, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 1}}, EdgeRoute{{0, 1, 0}, {0, 1, 0}, {}, {}},
          EdgeRoute{{0, 1, 0}, {2, 1, 0}, {}, {0, 0, 1}}})
        for (int axis = 0; axis < 3; ++axis) {
            glm::dvec3 step(0);
            step[axis] = 1e-5;
            const EdgePath here = edgePath(one, source, listener);
            EXPECT_NEAR((edgePath(one, source + step, listener).length - here.length) / 1e-5, here.toSource[axis],
                        1e-4);
            EXPECT_NEAR((edgePath(one, source, listener + step).length - here.length) / 1e-5, here.toListener[axis],
                        1e-4);
        }
}

TEST(PoleBank, HearsATone) {
    PoleBank::Weights weights{};
    for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = static_cast<float>(std::sin(3.0 * double(k) + 1));
    for (const double hz : {100., 3000.}) {
        PoleBank bank(kFollowedRate);
        const double w = 2 * std::numbers::pi * hz / kFollowedRate;
        const std::complex<double> value = valueAt(weights, hz);
        std::vector<float> ahead(100), heard(100);
        double worst = 0;
        for (int block = 0; block < 120; ++block) {
            const int start = 100 * block;
            for (int i = 0; i < 100; ++i)
                ahead[static_cast<std::size_t>(i)] =
                    static_cast<float>(std::cos(w * (start + i + static_cast<int>(PoleBank::kAhead))));
            bank.process(ahead, weights, weights, heard);
            for (int i = 0; i < 100 && block > 110; ++i)
                worst = std::max(worst, std::abs(static_cast<double>(heard[static_cast<std::size_t>(i)]) -
                                                 (value * std::polar(1.0, w * (start + i))).real()));
        }
        EXPECT_LE(worst, 1e-3 * std::abs(value)) << hz;
    }
    // Weights go evenly from one set to the next.
    PoleBank bank(kFollowedRate);
    const PoleBank::Weights none{};
    PoleBank::Weights through{};
    through[PoleBank::kPoles + PoleBank::kAhead] = 1;
    std::vector<float> ones(64, 1.0f), heard(64);
    bank.process(ones, none, none, heard);
    bank.process(ones, none, through, heard);
    for (std::size_t i = 0; i < 64; ++i) EXPECT_NEAR(heard[i], static_cast<float>(i + 1) / 64, 1e-6);
}

}  // namespace
}  // namespace rtsg
