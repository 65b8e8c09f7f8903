// Listeners that share the rays of a source: each must hear what it would alone, and what closed forms say.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "audio/trace/scattered.h"
#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"
#include "rays/acoustic_tracer.h"

namespace rtsg {
namespace {

using test::fromPlaneBelow;
using test::scatteredEnergy;
using test::Shoebox;
using test::shortTrace;
using test::TriangleGeometry;

/// However few the rays: the mean over many runs is the integral, for the near and the far alike.
TEST(SeveralListeners, ADiffusePlaneSendsEachWhatTheIntegralSays) {
    ASSERT_NEAR(fromPlaneBelow(.2, 2, 2), .8 / (8 * M_PI * 4), 1e-9);
    TriangleGeometry plane;
    plane.addQuad({-300, -300, 0}, {300, -300, 0}, {300, 300, 0}, {-300, 300, 0}, plane.addMaterial(.2, 1));
    plane.finish();
    const double heights[] = {2, .5, 3, 1, 6, 4, 2.5};
    std::vector<glm::dvec3> listeners;
    for (const double k : heights) listeners.emplace_back(0, 0, k);
    constexpr int kRuns = 300;
    std::vector<double> sum(listeners.size()), squares(listeners.size());
    for (int run = 0; run < kRuns; ++run) {
        const auto results = AcousticTracer(plane).trace({0, 0, 2}, listeners, shortTrace(320, 1 + run, 2));
        ASSERT_EQ(results.size(), listeners.size());
        for (std::size_t i = 0; i < results.size(); ++i) {
            const double late = scatteredEnergy(results[i]);
            sum[i] += late / kRuns, squares[i] += late * late / kRuns;
            EXPECT_EQ(results[i].rays, 320u);
        }
    }
    for (std::size_t i = 0; i < listeners.size(); ++i) {
        const double exact = fromPlaneBelow(.2, 2, heights[i]);
        const double error = std::sqrt((squares[i] - sum[i] * sum[i]) / kRuns);
        EXPECT_LT(error, .032 * exact) << heights[i];
        // Beyond 5 standard errors by chance less than once in a million.
        EXPECT_NEAR(sum[i], exact, 5 * error) << heights[i];
    }
}

/// Both ways to count, in bands that differ, behind a wall that lets sound pass and in the open room.
TEST(SeveralListeners, HearWhatEachHearsAlone) {
    for (const double transmission : {0.0, .3}) {
        TriangleGeometry room;
        const std::uint32_t wall = room.addMaterial(.2, .4), screen = room.addMaterial(.2, .3, transmission);
        room.addBox({0, 0, 0}, {6, 5, 3}, {wall, wall, wall, wall, wall, wall});
        room.addQuad({2.5, 1, 0}, {2.5, 5, 0}, {2.5, 5, 2.5}, {2.5, 1, 2.5}, screen);
        room.finish();
        const AcousticTracer tracer(room);
        const glm::dvec3 source{1, 1, 1.5};
        const std::vector<glm::dvec3> listeners{{4, 3, 1.5}, {1, 4, 1.2}, {5.5, .4, .3}, {5, 4.5, 2}, {3, 2, 1}};
        const auto shared = tracer.trace(source, listeners, shortTrace(9600, 3, 2));
        for (std::size_t i = 0; i < listeners.size(); ++i) {
            const TraceResult alone = tracer.trace(source, listeners[i], shortTrace(9600, 4, 2));
            ASSERT_EQ(shared[i].arrivals.size(), alone.arrivals.size());
            EXPECT_EQ(shared[i].receiverRadius, alone.receiverRadius);
            EXPECT_NEAR(shared[i].absorbed[kBand1k], 1, .01);
            const MetricsEstimate a = shared[i].metrics(), b = alone.metrics();
            for (const auto figure : {&RoomMetrics::edt, &RoomMetrics::t20, &RoomMetrics::t30, &RoomMetrics::c80,
                                      &RoomMetrics::d50, &RoomMetrics::ts, &RoomMetrics::g}) {
                const double ci = std::hypot((a.ci95.*figure)[kBand1k], (b.ci95.*figure)[kBand1k]);
                // Of some hundred comparisons, one exceeds twice the interval by chance in a hundred runs.
                EXPECT_NEAR((a.value.*figure)[kBand1k], (b.value.*figure)[kBand1k], 2 * ci)
                    << i << " through " << transmission;
                EXPECT_LT((a.ci95.*figure)[kBand1k], 4 * (b.ci95.*figure)[kBand1k]) << i;
            }
        }
    }
}

TEST(SeveralListeners, RepeatRefineAndLeaveNobodyElseOut) {
    const TriangleGeometry box = Shoebox::uniform({6, 5, 3}, .3, .4).geometry();
    const AcousticTracer tracer(box);
    const glm::dvec3 source{1, 1, 1.5};
    const std::vector<glm::dvec3> listeners{{4, 3, 1.5}, {2, 4, 1}};
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<glm::dvec3> more{{4, 3, 1.5}, {nan, 0, 0}, {2, 4, 1}, {2e6, 0, 0}};
    auto a = tracer.trace(source, listeners, shortTrace(480, 2, 2));
    const auto b = tracer.trace(source, more, shortTrace(480, 2, 2));
    ASSERT_EQ(b.size(), 4u);
    EXPECT_EQ(a[0].echogram().total(), b[0].echogram().total());
    EXPECT_EQ(a[1].echogram().total(), b[2].echogram().total());
    EXPECT_TRUE(b[1].batches.empty());
    EXPECT_TRUE(b[3].arrivals.empty());
    const double before = std::max(largestError(a[0].metrics()), largestError(a[1].metrics()));
    const double reached = tracer.refineTo(a, source, listeners, shortTrace(480, 2, 2), before / 2, 1'000'000);
    EXPECT_LE(reached, before / 2);
    EXPECT_EQ(reached, std::max(largestError(a[0].metrics()), largestError(a[1].metrics())));
    EXPECT_EQ(a[0].rays, a[1].rays);
    EXPECT_TRUE(tracer.trace(source, std::span<const glm::dvec3>(), shortTrace(480, 2, 2)).empty());
}

/// A source on a screen is before it for one listener and behind it for another.
TEST(SeveralListeners, ASourceOnAScreenIsOnTheSideOfEach) {
    TriangleGeometry screen;
    screen.addQuad({-4, -4, 0}, {4, -4, 0}, {4, 4, 0}, {-4, 4, 0}, screen.addMaterial(.1, .9));
    screen.finish();
    const std::vector<glm::dvec3> listeners{{0, 0, 3}, {0, 0, -3}, {1, 0, 2}};
    TraceOptions o = shortTrace(320, 1, 2);
    o.diffractionOrder = 0;
    const auto results = AcousticTracer(screen).trace({.1, .2, 0}, listeners, o);
    for (const TraceResult& result : results) {
        ASSERT_FALSE(result.arrivals.empty());
        EXPECT_EQ(result.arrivals[0].order, 0u);
        EXPECT_EQ(result.rays, 320u);
    }
}

}  // namespace
}  // namespace rtsg
