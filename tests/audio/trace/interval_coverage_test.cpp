// How often the intervals of a traced room's figures hold what the room has, over rooms, scatterings and rays.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/renderers/parallel_for.h>

#include "audio/trace/trace_options.h"
#include "audio/triangle_geometry.h"

namespace rtsg {
namespace {

using namespace test;

constexpr Bands RoomMetrics::* kAll[] = {&RoomMetrics::edt, &RoomMetrics::t20, &RoomMetrics::t30, &RoomMetrics::c50,
                                         &RoomMetrics::c80, &RoomMetrics::d50, &RoomMetrics::ts,  &RoomMetrics::g};
constexpr const char* kNames[] = {"EDT", "T20", "T30", "C50", "C80", "D50", "Ts", "G"};

struct Covered {
    double runs = 0, times[8] = {};
};

/// Traces by other seeds.
std::vector<TraceResult> traced(const TriangleGeometry& room, const glm::dvec3& source, const glm::dvec3& listener,
                                std::uint64_t rays, int runs, double seconds,
                                int imageOrder = TraceOptions().imageOrder) {
    std::vector<TraceResult> results(static_cast<std::size_t>(runs));
    parallelFor(results.size(), [&](std::size_t i) {
        TraceOptions o = shortTrace(rays, 1 + i, imageOrder);
        o.maxSeconds = seconds;
        results[i] = AcousticTracer(room).trace(source, listener, o);
    });
    return results;
}

/// The figures of all of them together, whose own error is small beside each interval.
RoomMetrics truthOf(const std::vector<TraceResult>& results) {
    Echogram all = results.front().echogram();
    all.late.bins.clear();
    for (const TraceResult& result : results)
        all.late.accumulate(result.echogram().late, 1.0 / static_cast<double>(results.size()));
    return roomMetrics(all);
}

void cover(const TriangleGeometry& room, std::uint64_t rays, int runs, double seconds, Covered& covered) {
    const std::vector<TraceResult> results = traced(room, kSource, kListener, rays, runs, seconds);
    const RoomMetrics truth = truthOf(results);
    covered.runs += runs;
    for (const TraceResult& result : results) {
        const MetricsEstimate m = result.metrics();
        for (std::size_t f = 0; f < 8; ++f)
            covered.times[f] += std::abs((m.value.*kAll[f])[0] - (truth.*kAll[f])[0]) <= (m.ci95.*kAll[f])[0] ? 1 : 0;
    }
}

/// Two of the rooms have late sound of few rays: those between their live walls.
TEST(IntervalCoverage, IsWhatIntervalsSayInRoomsThatScatterLittleAndMuchByFewAndManyRays) {
    Shoebox uneven = Shoebox::uniform({6, 5, 3}, .1, .3), two = Shoebox::uniform({6, 5, 3}, .6, .3);
    uneven.absorption[4] = uneven.absorption[5] = .5;
    two.absorption[4] = two.absorption[5] = .1;
    Covered few, many, fewUneven;
    const auto take = [&](const Shoebox& box, double seconds) {
        const TriangleGeometry room = box.geometry();
        cover(room, 400, 120, seconds, few);
        cover(room, 2400, 60, seconds, many);
    };
    take(Shoebox::uniform({6, 5, 3}, .1, .5), 1.4);
    take(Shoebox::uniform({6, 5, 3}, .1, .1), 1.5);
    take(Shoebox::uniform({6, 5, 3}, .3, 1), .6);
    take(uneven, .9);
    take(two, 1);
    cover(uneven.geometry(), 400, 240, .9, fewUneven);
    cover(two.geometry(), 400, 240, 1, fewUneven);
    for (std::size_t f = 0; f < 8; ++f) {
        // Binomial with p = .95: one standard deviation is .009 of few rays, .013 of many, .007 of all, .010 of uneven.
        EXPECT_NEAR(few.times[f] / few.runs, .95, .03) << kNames[f];
        EXPECT_NEAR(many.times[f] / many.runs, .95, .035) << kNames[f];
        EXPECT_NEAR((few.times[f] + many.times[f]) / (few.runs + many.runs), .95, .025) << kNames[f];
        // With 400 rays, single early rays make up most of D50's error there: .91.
        EXPECT_NEAR(fewUneven.times[f] / fewUneven.runs, .95, .045) << kNames[f];
        RecordProperty(std::string(kNames[f]) + "_few", std::to_string(few.times[f] / few.runs));
        RecordProperty(std::string(kNames[f]) + "_many", std::to_string(many.times[f] / many.runs));
        RecordProperty(std::string(kNames[f]) + "_uneven", std::to_string(fewUneven.times[f] / fewUneven.runs));
    }
}

/// Nothing comes straight: what is first are ways over the screen that few of the rays take. Where the first bin with
/// anything in it was the onset, widths of C80 and Ts differed by 7 and 20 times from seed to seed.
TEST(IntervalCoverage, BehindAScreenIntervalsAreAsWideWhateverTheSeedAndHoldTheTruth) {
    TriangleGeometry room;
    const std::uint32_t wall = room.addMaterial(.2, .4), screen = room.addMaterial(.2, .3);
    room.addBox({0, 0, 0}, {6, 5, 3}, {wall, wall, wall, wall, wall, wall});
    room.addQuad({2.5, 1, 0}, {2.5, 5, 0}, {2.5, 5, 2.5}, {2.5, 1, 2.5}, screen);
    room.finish();
    constexpr int kRuns = 60;
    const std::vector<TraceResult> results = traced(room, {1, 1, 1.5}, {3, 2, 1}, 9600, kRuns, .6, 2);
    const RoomMetrics truth = truthOf(results);
    for (std::size_t f = 3; f < 7; ++f) {  // C50 to Ts
        double minimum = 1e9, maximum = 0, covered = 0, mean = 0, squares = 0, widths = 0;
        for (const TraceResult& result : results) {
            const MetricsEstimate m = result.metrics();
            const double value = (m.value.*kAll[f])[0], width = (m.ci95.*kAll[f])[0];
            minimum = std::min(minimum, width), maximum = std::max(maximum, width), widths += width / kRuns;
            mean += value / kRuns, squares += value * value / kRuns;
            covered += std::abs(value - (truth.*kAll[f])[0]) <= width ? 1 : 0;
        }
        EXPECT_LT(maximum, 3 * minimum) << kNames[f];
        // Binomial with p = .95: one standard deviation is 1.7 of 60.
        EXPECT_GE(covered, 52) << kNames[f];
        // Nor are they wider than values scatter: t with 15 degrees of freedom, and some of what stands out.
        EXPECT_LT(widths, 1.4 * 2.13 * std::sqrt(squares - mean * mean)) << kNames[f];
        RecordProperty(std::string(kNames[f]) + "_widths", std::to_string(maximum / minimum));
        RecordProperty(std::string(kNames[f]) + "_covered", std::to_string(covered / kRuns));
    }
}

}  // namespace
}  // namespace rtsg
