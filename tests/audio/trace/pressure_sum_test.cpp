// Sums of pressures in two walks beside the sum over all pairs.
#include <cmath>
#include <complex>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "response/pressure_sum.h"

namespace rtsg {
namespace {

using Turned = std::complex<double>;
constexpr double kSumSpeed = 343;
/// Half the width of a fifth of an octave.
const double kHalf = std::sinh(.1 * std::log(2.0));

struct Came {
    double pathLength;
    std::vector<Turned> pressure;  // by tone, re the phase of the way
};

double left(double y) {
    return (1 + y + y * y / 3) * std::exp(-y);
}

TEST(PressureSum, IsThatOverAllPairs) {
    const unsigned seed = 2911;
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (const double spread : {0.0, .01, .3, 10.0, 300.0}) {
        std::vector<Came> all(40);
        for (Came& one : all) {
            one.pathLength = 7 + spread * std::uniform_real_distribution<double>()(random);
            for (std::size_t t = 0; t < kEdgeTones; ++t) one.pressure.emplace_back(normal(random), normal(random));
        }
        PressureSum sum(kSumSpeed);
        std::vector<Arrival> arrivals(all.size());
        for (std::size_t i = 0; i < all.size(); ++i)
            sum.add(i, all[i].pathLength, [&](std::size_t t) { return all[i].pressure[t]; });
        sum.addEnergies(arrivals);
        for (std::size_t i = 0; i < all.size(); ++i)
            for (std::size_t b = 0; b < kBandCount; ++b) {
                double energy = 0;
                for (std::size_t t = 5 * b; t < 5 * b + 5; ++t) {
                    const double k = 2 * M_PI * edgeToneHz(double(t)) / kSumSpeed;
                    for (const Came& other : all) {
                        const double apart = all[i].pathLength - other.pathLength;
                        energy +=
                            left(kHalf * k * std::abs(apart)) *
                            (all[i].pressure[t] * std::polar(1.0, -k * apart) * std::conj(other.pressure[t])).real();
                    }
                }
                EXPECT_NEAR(4 * M_PI * arrivals[i].energy[b], energy / 5, 2e-4) << spread << " m, " << i << ", " << b;
            }
    }
}

TEST(PressureSum, NearToEachOtherItIsAFlatFifthOfAnOctave) {
    for (const double metres : {.001, .01, .05}) {
        PressureSum sum(kSumSpeed);
        std::vector<Arrival> arrivals(2);
        sum.add(0, 5, [](std::size_t) { return 1.0; });
        sum.add(1, 5 + metres, [](std::size_t) { return -1.0; });
        sum.addEnergies(arrivals);
        for (std::size_t b = 0; b < kBandCount; ++b) {
            double mean = 0;
            constexpr int kTones = 2000;
            for (int i = 0; i < kTones; ++i) {
                // Evenly by frequency within each fifth.
                const double middle = edgeToneHz(double(5 * b) + i / (kTones / 5));
                const double hz = middle * (1 + kHalf * (2 * (i % (kTones / 5) + .5) / (kTones / 5) - 1));
                mean += std::norm(1.0 - std::polar(1.0, -2 * M_PI * hz / kSumSpeed * metres)) / kTones;
            }
            const double energy = 4 * M_PI * (arrivals[0].energy[b] + arrivals[1].energy[b]);
            EXPECT_NEAR(energy, mean, .03 * mean + 1e-6) << metres << " m, band " << b;
        }
    }
}

}  // namespace
}  // namespace rtsg
