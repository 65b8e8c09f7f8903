// The table by which rays are split and played: what it says, and that it moves nothing but chance.
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/renderers/parallel_for.h>

#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"
#include "trace/fading_energy.h"

namespace rtsg {
namespace {

using namespace test;
using trace::FadingEnergy;

/// Of rays that lose e times their energy each so many metres, two and a half times as much or as little.
FadingEnergy fadingBy(double metres) {
    FadingEnergy fading;
    for (int i = 1; i <= 2000; ++i) {
        const double at = .005 * i * metres;
        fading.add(at, (i % 2 ? 1.6 : .4) * std::exp(-at / metres));
    }
    fading.settle();
    return fading;
}

TEST(FadingEnergy, IsTheMeanOfThoseUnderWay) {
    const FadingEnergy fading = fadingBy(20);
    for (const double metres : {5.0, 20.0, 60.0, 100.0})
        EXPECT_NEAR(fading.target(metres) / std::exp(-metres / 20), 1, .05) << metres;
    // Later a ray more or less tells little: their number falls with the root of what is left. Beyond the last that was
    // followed that goes on as before.
    for (const double metres : {170.0, 300.0})
        EXPECT_NEAR(fading.target(metres) / std::sqrt(1e-3 * std::exp(-metres / 20)), 1, .2) << metres;
    EXPECT_GT(fading.target(1e9), 0);
}

TEST(FadingEnergy, OfNothingSplitsNothing) {
    FadingEnergy fading;
    EXPECT_EQ(fading.target(10), 1);
    fading.settle();
    EXPECT_EQ(fading.target(10), 1);
    // A ray that met nothing but what takes all.
    for (int i = 0; i < 100; ++i) fading.add(i, 0);
    fading.settle();
    EXPECT_EQ(fading.target(10), 1);
}

/// With tables that are off by any factor the same energy arrives at the same time.
TEST(FadingEnergy, MovesNoExpectation) {
    Shoebox uneven = Shoebox::uniform({6, 5, 3}, .1, .3);
    uneven.absorption[4] = uneven.absorption[5] = .5;
    const TriangleGeometry room = uneven.geometry();
    const AcousticTracer tracer(room);
    std::vector<MetricsEstimate> found;
    for (const double metres : {8.0, 15.0, 40.0}) {
        TraceOptions o = shortTrace(400, 5, 3);
        o.maxSeconds = .6;
        TraceResult result = tracer.trace(kSource, kListener, o);
        result.fading = std::make_shared<const FadingEnergy>(fadingBy(metres));
        for (EnergyHistogram& batch : result.batches) batch.bins.clear();
        result.rays = 0;
        tracer.refine(result, kSource, kListener, o, 8000);
        found.push_back(result.metrics());
        EXPECT_NEAR(result.absorbed[0] + result.truncated[0], 1, 5e-3) << metres;
    }
    for (const auto figure : {&RoomMetrics::g, &RoomMetrics::edt, &RoomMetrics::t20, &RoomMetrics::c80})
        for (const std::size_t other : {0u, 2u}) {
            const double ci = std::hypot((found[1].ci95.*figure)[0], (found[other].ci95.*figure)[0]);
            EXPECT_NEAR((found[other].value.*figure)[0], (found[1].value.*figure)[0], 1.5 * ci) << other;
        }
}

/// Of a source that sends 64 times as much to all sides all is 64 times as much, and nothing else.
TEST(FadingEnergy, CountsWhatASourceSends) {
    const TriangleGeometry room = Shoebox::uniform({6, 5, 3}, .2, .4).geometry();
    TraceOptions plain = shortTrace(400, 3, 4), loud = plain;
    loud.pattern = [](const glm::dvec3&) { return 64.0; };
    const TraceResult one = AcousticTracer(room).trace(kSource, kListener, plain),
                      other = AcousticTracer(room).trace(kSource, kListener, loud);
    ASSERT_EQ(one.batches.size(), other.batches.size());
    for (std::size_t i = 0; i < one.batches.size(); ++i) {
        ASSERT_EQ(one.batches[i].bins.size(), other.batches[i].bins.size());
        for (std::size_t k = 0; k < one.batches[i].bins.size(); ++k)
            ASSERT_NEAR(other.batches[i].bins[k][0], 64 * one.batches[i].bins[k][0],
                        1e-9 * other.batches[i].bins[k][0]);
    }
}

/// In a room with two dead walls what is heard late went along the others all the time; few of the rays that are sent
/// do.
TEST(FadingEnergy, HasAsManyRaysWhereTheRoomIsAlive) {
    Shoebox uneven = Shoebox::uniform({6, 5, 3}, .1, .3);
    uneven.absorption[4] = uneven.absorption[5] = .5;
    const TriangleGeometry room = uneven.geometry();
    std::vector<double> t30(60);
    parallelFor(t30.size(), [&](std::size_t i) {
        TraceOptions o = shortTrace(400, 1 + i, TraceOptions().imageOrder);
        o.maxSeconds = .9;
        t30[i] = AcousticTracer(room).trace(kSource, kListener, o).metrics().value.t30[0];
    });
    double mean = 0, squares = 0;
    for (const double t : t30) mean += t / static_cast<double>(t30.size());
    for (const double t : t30) squares += (t - mean) * (t - mean) / static_cast<double>(t30.size() - 1);
    RecordProperty("spread", std::to_string(std::sqrt(squares) / mean));
    EXPECT_LT(std::sqrt(squares) / mean, .04);
}

}  // namespace
}  // namespace rtsg
