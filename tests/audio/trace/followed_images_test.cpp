// Which images of a source are followed, where they go, and what filters are made of what walls left of them.
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "audio/triangle_geometry.h"
#include "images/followed_images.h"
#include "images/image_sources.h"

namespace rtsg {
namespace {

using test::TriangleGeometry;

double amplitudeOfFilter(const std::vector<float>& response, double hz, double rate) {
    std::complex<double> sum = 0;
    for (std::size_t i = 0; i < response.size(); ++i)
        sum += static_cast<double>(response[i]) *
               std::polar(1.0, -2 * std::numbers::pi * hz * static_cast<double>(i) / rate);
    return std::abs(sum);
}

TEST(FollowedImages, FiltersHaveTheAmplitudesOfTheirBandsAndNoDelay) {
    std::mt19937 random(7);
    for (int trial = 0; trial < 20; ++trial) {
        // As for walls: no more than 2 dB from octave to octave.
        Bands amplitudes;
        double db = -3;
        for (double& amplitude : amplitudes) {
            amplitude = std::pow(10, db / 20);
            db -= 2.0 * static_cast<double>(random() % 1000) / 1000;
        }
        const std::vector<float> filter = minimumPhase(amplitudes, 48000, 256);
        ASSERT_EQ(filter.size(), 256u);
        for (int b = 4; b < kBandCount; ++b) {
            const double hz = 1000 * std::pow(2.0, b - kBand1k), exact = amplitudes[static_cast<std::size_t>(b)];
            EXPECT_NEAR(20 * std::log10(amplitudeOfFilter(filter, hz, 48000) / exact), 0, .25) << trial << ' ' << hz;
        }
        // Nearly all of its energy is in its first millisecond.
        double early = 0, all = 0;
        for (std::size_t i = 0; i < filter.size(); ++i) {
            const double energy = static_cast<double>(filter[i]) * static_cast<double>(filter[i]);
            all += energy;
            if (i < 48) early += energy;
        }
        EXPECT_GT(early / all, .98);
    }
    const std::vector<float> flat = minimumPhase(allBands(.5), 48000, 64);
    EXPECT_NEAR(flat[0], .5, 1e-6);
    for (std::size_t i = 1; i < flat.size(); ++i) EXPECT_NEAR(flat[i], 0, 1e-6);
}

/// In a box all images are seen from everywhere: where they go with the source is where a search from there has them.
TEST(FollowedImages, GoWhereASearchFromThereHasThem) {
    const TriangleGeometry room = test::Shoebox::uniform({6, 5, 3}, .1).geometry();
    const auto imagesFrom = [&](const glm::dvec3& source, const glm::dvec3& listener) {
        return Echogram{findImageSources(room, source, listener, {.maxOrder = 3}, 343, Bands{}).arrivals, {}};
    };
    const glm::dvec3 source(1, 2, 1.2), listener(4, 3, 1.5), moved(2.3, 1.1, .7), ears(3.1, 3.9, 1.9);
    const auto followed = followedImages(imagesFrom(source, listener), source, listener, 343, 48000, 256, 1000);
    const Echogram there = imagesFrom(moved, ears);
    EXPECT_EQ(followed.size() + 1, there.arrivals.size());
    for (const FollowedImage& image : followed) {
        const glm::dvec3 at = image.at(moved);
        EXPECT_TRUE(std::ranges::any_of(there.arrivals,
                                        [&](const Arrival& arrival) {
                                            return glm::distance(ears + arrival.direction * (arrival.seconds * 343),
                                                                 at) < 1e-5;
                                        }))
            << at.x << ' ' << at.y << ' ' << at.z;
        EXPECT_FALSE(image.filtered) << "nothing but a share is lost";
    }
}

TEST(FollowedImages, AreTheLoudestAndLeaveTheRest) {
    const TriangleGeometry room = test::Shoebox::uniform({6, 5, 3}, .3).geometry();
    const glm::dvec3 source(1, 2, 1.2), listener(4, 3, 1.5);
    Echogram all{findImageSources(room, source, listener, {.maxOrder = 2}, 343, Bands{}).arrivals, {}};
    const auto followed = followedImages(all, source, listener, 343, 48000, 256, 5);
    ASSERT_EQ(followed.size(), 5u);
    const Echogram rest = without(all, followed);
    double loudest = 0;
    for (const Arrival& arrival : rest.arrivals)
        if (arrival.order > 0) loudest = std::max(loudest, arrival.energy[kBand1k]);
    for (const FollowedImage& image : followed) {
        const Arrival& arrival = all.arrivals[image.arrival];
        EXPECT_GT(arrival.order, 0u);
        EXPECT_GE(arrival.energy[kBand1k], loudest);
        EXPECT_EQ(rest.arrivals[image.arrival].energy[kBand1k], 0);
        // Pressure at a metre from the image, of which 1 / d arrives.
        const double distance = glm::distance(image.at(source), listener);
        EXPECT_NEAR(std::pow(image.pressure / distance, 2), 4 * std::numbers::pi * arrival.energy[kBand1k], 1e-9);
    }
    // Diffracted sound is no image.
    for (Arrival& arrival : all.arrivals) arrival.rotation = glm::mat3(0.0f);
    EXPECT_TRUE(followedImages(all, source, listener, 343, 48000, 256, 5).empty());
}

}  // namespace
}  // namespace rtsg
