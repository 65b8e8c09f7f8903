// How often the intervals of a traced room's figures hold what the room has, over rooms, scatterings and rays.
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

/// Of traces by other seeds, of the figures of all of them together, whose own error is small beside each interval.
void cover(const TriangleGeometry& room, std::uint64_t rays, int runs, double seconds, Covered& covered) {
    std::vector<TraceResult> results(static_cast<std::size_t>(runs));
    parallelFor(results.size(), [&](std::size_t i) {
        TraceOptions o = shortTrace(rays, 1 + i, TraceOptions().imageOrder);
        o.maxSeconds = seconds;
        results[i] = AcousticTracer(room).trace(kSource, kListener, o);
    });
    Echogram all = results.front().echogram();
    all.late.bins.clear();
    for (const TraceResult& result : results) all.late.accumulate(result.echogram().late, 1.0 / runs);
    const RoomMetrics truth = roomMetrics(all);
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
        // Of 400 rays single ones that are heard early are most of D50's error there: .91.
        EXPECT_NEAR(fewUneven.times[f] / fewUneven.runs, .95, .045) << kNames[f];
        RecordProperty(std::string(kNames[f]) + "_few", std::to_string(few.times[f] / few.runs));
        RecordProperty(std::string(kNames[f]) + "_many", std::to_string(many.times[f] / many.runs));
        RecordProperty(std::string(kNames[f]) + "_uneven", std::to_string(fewUneven.times[f] / fewUneven.runs));
    }
}

}  // namespace
}  // namespace rtsg
