// Energies of one band from a time on.
#include <gtest/gtest.h>

#include "response/band_decay.h"

namespace rtsg::trace {
namespace {

TEST(BandDecay, CountsFromAnyTimeAndBackAgain) {
    Echogram echogram{{}, {1000, std::vector<Bands>(31), .0005}};
    for (const double seconds : {.02, .05}) echogram.arrivals.push_back({seconds, allBands(1), {}, 0});
    echogram.late.bins[30] = allBands(.4);
    BandDecay decay(echogram, 3);
    const auto expect = [&](double onset, double total, double moment) {
        EXPECT_EQ(decay.onset(), onset);
        EXPECT_EQ(decay.all(), 2.4);
        EXPECT_NEAR(decay.total(), total, 1e-15);
        EXPECT_NEAR(decay.moment(), moment, 1e-15);
    };
    expect(.02, 2.4, .07 + .4 * .031);
    decay.beginAt(.03075);  // a quarter of the bin is over
    expect(.03075, 1.3, .05 + .3 * .031125);
    decay.beginAt(.05);
    expect(.05, 1, .05);
    EXPECT_EQ(decay.after(.05), 0);
    decay.beginAt(.02);
    expect(.02, 2.4, .07 + .4 * .031);
    EXPECT_EQ(decay.after(.02), 1.4);
}

}  // namespace
}  // namespace rtsg::trace
