// Interaural cross-correlation against a transform in double precision, sum by sum.
#include <cmath>
#include <complex>
#include <numbers>

#include <gtest/gtest.h>

#include <rtsg/audio/impulse_response.h>

#include "response/interaural.h"

namespace rtsg {
namespace {

constexpr int kEarRate = 48000;

std::shared_ptr<const Hrtf> sphere() {
    return Hrtf::sphere(kEarRate, .0875, 343);
}

/// The largest correlation of the ears within a millisecond, in an octave, for uncorrelated sound from some directions
/// with some energies.
double correlationOf(const Hrtf& head, std::span<const std::pair<glm::dvec3, double>> heard, int band) {
    constexpr int kLags = 201;
    constexpr double kStep = 15;  // Hz
    std::vector<double> cross(kLags);
    double left = 0, right = 0;
    for (const auto& [direction, energy] : heard) {
        const Hrtf::Ears ears = head.at(direction);
        for (double hz = kStep; hz < kEarRate / 2.0; hz += kStep) {
            const double weight = bandWeight(band, hz);
            if (weight == 0) continue;
            std::complex<double> l = 0, r = 0;
            const std::complex<double> angle = std::polar(1.0, -2 * std::numbers::pi * hz / kEarRate);
            std::complex<double> phase = 1;
            for (std::size_t i = 0; i < ears[0].size(); ++i, phase *= angle)
                l += phase * static_cast<double>(ears[0][i]), r += phase * static_cast<double>(ears[1][i]);
            const double power = energy * weight * weight;
            left += power * std::norm(l), right += power * std::norm(r);
            const std::complex<double> product = power * l * std::conj(r);
            for (int k = 0; k < kLags; ++k) {
                const double delay = (2.0 * k / (kLags - 1) - 1) * .001;
                cross[static_cast<std::size_t>(k)] +=
                    std::real(product * std::polar(1.0, 2 * std::numbers::pi * hz * delay));
            }
        }
    }
    double maximum = 0;
    for (const double value : cross) maximum = std::max(maximum, std::abs(value));
    return maximum / std::sqrt(left * right);
}

glm::dvec3 fromSide(double degrees) {
    const double angle = degrees * std::numbers::pi / 180;
    return {std::sin(angle), 0, -std::cos(angle)};
}

TEST(Interaural, EarsThatHearTheSameAreAlike) {
    const EarCorrelation ears(*sphere());
    const std::array ahead{Arrival{.01, allBands(1), {0, 0, -1}, 0}, Arrival{.05, allBands(.5), {0, 1, 0}, 1},
                           Arrival{.2, allBands(.1), {0, 0, 1}, 2}};
    const InterauralEstimate found = ears.estimate(ahead, {}, {1, 0, 0});
    for (std::size_t b = 0; b < kBandCount; ++b) {
        EXPECT_NEAR(found.value.early[b], 1, 2e-3) << kBandHz[b];
        EXPECT_NEAR(found.value.late[b], 1, 2e-3) << kBandHz[b];
        EXPECT_EQ(found.ci95.early[b], 0);
    }
    EXPECT_TRUE(std::isnan(ears.estimate({}, {}, {1, 0, 0}).value.early[kBand1k]));
}

TEST(Interaural, OfDirectSoundAndReflectionsByTheirAngles) {
    const auto head = sphere();
    const EarCorrelation ears(*head);
    for (const double degrees : {20.0, 55.0, 90.0, -40.0})
        for (const double energy : {.3, 1.0}) {
            std::vector<Arrival> arrivals{{.01, allBands(1), {0, 0, -1}, 0},
                                          {.03, allBands(energy), fromSide(degrees), 1}};
            const std::array<std::pair<glm::dvec3, double>, 2> heard{
                {{glm::dvec3(0, 0, -1), 1.0}, {fromSide(degrees), energy}}};
            const InterauralEstimate found = ears.estimate(arrivals, {}, {1, 0, 0});
            for (const int band : {3, 4, 5, 6})
                EXPECT_NEAR(found.value.early[static_cast<std::size_t>(band)], correlationOf(*head, heard, band), .012)
                    << degrees << " degrees, " << kBandHz[static_cast<std::size_t>(band)] << " Hz";
        }
    // The axis is that of who faces the source: turned with it nothing changes.
    const glm::dvec3 across = glm::normalize(glm::dvec3(1, 0, 1)), ahead = glm::normalize(glm::dvec3(1, 0, -1));
    const std::array turned{Arrival{.01, allBands(1), ahead, 0}, Arrival{.03, allBands(1), across, 1}};
    const std::array straight{Arrival{.01, allBands(1), {0, 0, -1}, 0}, Arrival{.03, allBands(1), {1, 0, 0}, 1}};
    EXPECT_NEAR(ears.estimate(turned, {}, across).value.early[kBand1k],
                ears.estimate(straight, {}, {1, 0, 0}).value.early[kBand1k], 1e-9);
}

/// Ears that hear what has less and less in common, in a field that comes evenly from everywhere; and what comes from
/// the median plane, or from both sides, instead.
TEST(Interaural, OfRandomEnergyByItsLateralShare) {
    const auto head = sphere();
    const EarCorrelation ears(*head);
    std::vector<std::pair<glm::dvec3, double>> everywhere;
    constexpr int kDirections = 400;
    for (int i = 0; i < kDirections; ++i) {
        const double z = 1 - (2.0 * i + 1) / kDirections, r = std::sqrt(1 - z * z), angle = 2.39996322972865332 * i;
        everywhere.push_back({glm::dvec3(z, r * std::cos(angle), r * std::sin(angle)), 1.0 / kDirections});
    }
    const auto found = [&](double lateral) {
        std::vector<EnergyHistogram> batches(4);
        for (EnergyHistogram& batch : batches) {
            batch.bins.assign(300, allBands(.01));
            batch.lateral.assign(300, allBands(.01 * lateral));
        }
        return ears.estimate({}, batches, {1, 0, 0});
    };
    for (const int band : {2, 4, 5, 6, 7}) {
        const auto b = static_cast<std::size_t>(band);
        const double expected = correlationOf(*head, everywhere, band);
        EXPECT_NEAR(found(1.0 / 3).value.early[b], expected, .015) << kBandHz[b];
        EXPECT_NEAR(found(1.0 / 3).value.late[b], expected, .015) << kBandHz[b];
        EXPECT_NEAR(found(0).value.late[b], 1, 2e-3);
        EXPECT_NEAR(found(1.0 / 3).ci95.late[b], 0, 1e-9);
    }
    EXPECT_GT(found(1.0 / 3).value.early[2], .85);
    EXPECT_LT(found(1.0 / 3).value.early[6], .35);
    const std::array<std::pair<glm::dvec3, double>, 2> sides{{{glm::dvec3(-1, 0, 0), .5}, {glm::dvec3(1, 0, 0), .5}}};
    EXPECT_NEAR(found(1).value.early[5], correlationOf(*head, sides, 5), .012);
}

}  // namespace
}  // namespace rtsg
